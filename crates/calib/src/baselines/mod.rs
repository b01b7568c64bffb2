//! Inverses to compare the filter with: four without a model of the sensor, and the published law ([`PublishedLaw`]).
//!
//! [`Baselines::fit`] fits the four to recordings with known strain; each one then runs over readings row by row, as a
//! filter does. Their estimates are clipped to the strains they were fitted on. Ridge and time constant come from
//! cross-validation on contiguous blocks, on the same normal equations as the law's.

mod fir;
mod leaky_bank;
mod low_pass_mode;
mod published;
mod reading_scale;
mod regression;
mod static_cubic;

pub use fir::Fir;
pub use leaky_bank::LeakyBank;
pub use low_pass_mode::LowPassMode;
pub use published::{PhaseRows, PublishedLaw};
pub use regression::{Features, Regression};
pub(crate) use static_cubic::fit_static_cubic;
pub use static_cubic::running_cubic;

use crate::CalibrationError;
use crate::enough::check;
use crate::order::median;
use crate::samples::Samples;
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::StaticCubic;

/// Inverse running on one recording.
pub trait Baseline {
    /// Returns the strain at `time_s` from this reading and those before, within the range of the fit. A missing
    /// reading (NaN) keeps the last value; before the first reading that is the middle of the range. Times increase.
    fn strain(&mut self, time_s: f64, reading: f64) -> f64;
}

/// All four regressions, fitted to the same rows.
#[derive(Clone, Debug)]
pub struct Baselines {
    /// Cubic polynomial in the reading.
    pub static_cubic: StaticCubic,
    /// The readings of the last 20 s.
    pub fir: Regression<Fir>,
    /// The reading and one low-pass of it.
    pub low_pass_mode: Regression<LowPassMode>,
    /// Products of the reading and four low-passes of it.
    pub leaky_bank: Regression<LeakyBank>,
}

impl Baselines {
    /// Fits all of them to the rows with reading and strain.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Self, CalibrationError> {
        let (lower, upper) = check(recordings)?;
        Ok(Self {
            static_cubic: fit_static_cubic(recordings, StrainRange { lower, upper })?,
            fir: Fir::fit(recordings)?,
            low_pass_mode: LowPassMode::fit(recordings)?,
            leaky_bank: LeakyBank::fit(recordings)?,
        })
    }
}

/// Last estimate, clipped to a range; kept while there is no new one.
#[derive(Clone, Copy, Debug)]
struct Held {
    range: StrainRange<f64>,
    last: f64,
}

impl Held {
    fn new(range: StrainRange<f64>) -> Self {
        Self { range, last: 0.5 * (range.lower + range.upper) }
    }

    fn next(&mut self, strain: Option<f64>) -> f64 {
        if let Some(strain) = strain {
            self.last = self.range.clamp(strain);
        }
        self.last
    }
}

/// Returns the largest of the recordings' median sampling intervals, s, which all of them can resolve.
fn sampling_interval_s(recordings: &[Samples]) -> f64 {
    let step = |samples: &Samples| median(samples.time_s.windows(2).map(|pair| pair[1] - pair[0]));
    recordings.iter().filter_map(step).fold(0.0, f64::max)
}
