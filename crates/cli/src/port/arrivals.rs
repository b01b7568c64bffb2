use std::borrow::Cow;
use std::time::Instant;

/// Interval between lines that arrive at once, s: a hundred times the resolution of the written times.
const LEAST_STEP_S: f64 = 1e-4;

/// Lines of a stream under the header given by a flag; lines without a time get their time of arrival.
#[derive(Default)]
pub struct Headed {
    header: Option<String>,
    arrivals: Option<Arrivals>,
}

impl Headed {
    /// Creates a stream under the header of a flag, if there is one.
    pub fn new(header: Option<&str>) -> Self {
        let Some(header) = header else { return Self::default() };
        let has_time = header.split(',').any(|name| matches!(name.trim(), "time_s" | "time_us"));
        let whole = if has_time { header.to_owned() } else { format!("time_s,{header}") };
        Self { header: Some(whole), arrivals: (!has_time).then(Arrivals::default) }
    }

    /// Returns the header, with a column of times.
    pub fn header(&self) -> Option<&str> {
        self.header.as_deref()
    }

    /// Returns a line with its time.
    pub fn line<'a>(&mut self, line: &'a [u8], arrived: Instant) -> Cow<'a, [u8]> {
        match self.arrivals.as_mut().filter(|_| !line.trim_ascii().is_empty()) {
            Some(arrivals) => [format!("{:.6},", arrivals.time_s(arrived)).as_bytes(), line].concat().into(),
            None => line.into(),
        }
    }
}

/// Times of arrival, for lines without a time. Lines that arrive at once are each a little later than the one before.
#[derive(Default)]
struct Arrivals {
    first: Option<Instant>,
    last_s: Option<f64>,
}

impl Arrivals {
    fn time_s(&mut self, arrived: Instant) -> f64 {
        let elapsed_s = arrived.duration_since(*self.first.get_or_insert(arrived)).as_secs_f64();
        let time_s = self.last_s.map_or(elapsed_s, |last_s| elapsed_s.max(last_s + LEAST_STEP_S));
        self.last_s = Some(time_s);
        time_s
    }
}
