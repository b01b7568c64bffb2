use std::borrow::Cow;

/// Interval between lines that arrive at once, s: a hundred times the resolution of the written times.
const LEAST_STEP_S: f64 = 1e-4;

/// Lines of a stream under a header given by its user; lines without a time get their time of arrival. Lines that arrive at once are each a
/// little later than the one before.
///
/// ```
/// use ohmstrain_bench_data::Headed;
/// let mut headed = Headed::new(Some("resistance_ohm"));
/// assert_eq!(headed.header(), Some("time_s,resistance_ohm"));
/// let arrived = [(17.5, "1600"), (17.5, "1601"), (17.7, "1602")];
/// let lines = arrived.map(|(arrived_s, line)| headed.line(line.as_bytes(), arrived_s).into_owned());
/// assert_eq!(lines, [b"0.000000,1600", b"0.000100,1601", b"0.200000,1602"]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Headed {
    header: Option<String>,
    arrivals: Option<Arrivals>,
}

/// Times of arrival, for lines without a time.
#[derive(Clone, Debug)]
struct Arrivals {
    first_s: Option<f64>,
    /// Time of the last line since the first one, s.
    last_s: f64,
}

impl Headed {
    /// Creates a stream under a header, if one is given.
    #[must_use]
    pub fn new(header: Option<&str>) -> Self {
        let Some(header) = header else { return Self::default() };
        let has_time = header.split(',').any(|name| matches!(name.trim(), "time_s" | "time_us"));
        let whole = if has_time { header.to_owned() } else { format!("time_s,{header}") };
        let arrivals = (!has_time).then_some(Arrivals { first_s: None, last_s: -LEAST_STEP_S });
        Self { header: Some(whole), arrivals }
    }

    /// Returns the header, with a column of times.
    #[must_use]
    pub fn header(&self) -> Option<&str> {
        self.header.as_deref()
    }

    /// Returns a line with its time; it has arrived at `arrived_s` on any clock.
    pub fn line<'a>(&mut self, line: &'a [u8], arrived_s: f64) -> Cow<'a, [u8]> {
        let Some(Arrivals { first_s, last_s }) = self.arrivals.as_mut().filter(|_| !line.trim_ascii().is_empty())
        else {
            return line.into();
        };
        *last_s = (arrived_s - *first_s.get_or_insert(arrived_s)).max(*last_s + LEAST_STEP_S);
        [format!("{last_s:.6},").as_bytes(), line].concat().into()
    }
}
