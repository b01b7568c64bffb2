use ohmstrain_calib::{SensorParams, Validity};

use crate::input::reading_column;

/// Says, once for each, that a sensor is used outside of what its calibration has seen.
pub struct ValidityWatch {
    file: String,
    validity: Validity,
    quantity: &'static str,
    reading: &'static str,
    /// Readings that calibration has seen, moved to the R₀ in use.
    readings: (f64, f64),
    start_s: Option<f64>,
    long: bool,
    fast: Outside,
    beyond_readings: Outside,
    beyond_strains: Outside,
}

/// Rows outside of a range.
#[derive(Default)]
struct Outside {
    rows: usize,
    outside: usize,
    said: bool,
}

/// Rows outside are a matter of chance up to this number and this share: by definition 1 % of the calibration's own rows
/// are faster than its 99th percentile.
const CHANCE: (usize, f64) = (10, 0.02);

impl Outside {
    /// Whether it is time to say so.
    fn see(&mut self, outside: bool) -> bool {
        self.rows += 1;
        self.outside += usize::from(outside);
        let many = self.outside > CHANCE.0 && self.outside as f64 > CHANCE.1 * self.rows as f64;
        let now = many && !self.said;
        self.said |= now;
        now
    }
}

impl ValidityWatch {
    /// Watches the use of a sensor on `file` with the R₀ `rest_reading`.
    pub fn new(file: &str, params: &SensorParams, rest_reading: f64) -> Self {
        let (seen, moved) = (&params.validity, rest_reading / params.rest_reading);
        Self {
            file: file.to_string(),
            validity: params.validity,
            quantity: params.quantity.name(),
            reading: reading_column(params.reading),
            readings: (moved * seen.reading_lower, moved * seen.reading_upper),
            start_s: None,
            long: false,
            fast: Outside::default(),
            beyond_readings: Outside::default(),
            beyond_strains: Outside::default(),
        }
    }

    /// Takes a row and says what there is to `say`: the reading as recorded, the estimated rate, and the true strain; NaN for
    /// what is missing. An uncertain rate is estimated near zero, so that a high one means something.
    pub fn see(&mut self, time_s: f64, reading: f64, rate: f64, truth: f64, say: &mut dyn FnMut(String)) {
        let Validity { lower, upper, fastest_rate_per_s: fastest, duration_s, .. } = self.validity;
        let start_s = *self.start_s.get_or_insert(time_s);
        if !self.long && time_s - start_s > duration_s {
            self.long = true;
            say(self.warning(time_s, &format!("longer than the {duration_s:.1} s of the calibration")));
        }
        if self.fast.see(rate.abs() > fastest) {
            let quantity = self.quantity;
            say(self
                .warning(time_s, &format!("{quantity} changes faster than the calibration's {fastest:.4} per second")));
        }
        let (low, high) = self.readings;
        if reading.is_finite() && self.beyond_readings.see(!(low..=high).contains(&reading)) {
            let column = self.reading;
            say(self.warning(time_s, &format!("{column} is outside of the calibration's {low:.5} to {high:.5}")));
        }
        if truth.is_finite() && self.beyond_strains.see(!(lower..=upper).contains(&truth)) {
            let quantity = self.quantity;
            say(self.warning(time_s, &format!("{quantity} is outside of the calibration's {lower:.4} to {upper:.4}")));
        }
    }

    fn warning(&self, time_s: f64, what: &str) -> String {
        format!("{}: at {time_s} s: {what}; estimates are extrapolations", self.file)
    }
}
