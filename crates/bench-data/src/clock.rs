use crate::columns::Column;
use crate::error::{Fault, quote};

/// The range of a 32-bit microsecond counter.
const WRAP_US: u64 = 1 << 32;
/// Inverse of the share of a counter's range by which it may step forward in a wrap. A device that was restarted begins at 0, too, but
/// seldom so shortly before its counter would have wrapped.
pub(crate) const WRAP_WITHIN: u64 = 8;

/// The time column, checked to increase strictly.
#[derive(Clone, Copy)]
pub(crate) enum Clock {
    Seconds { last: Option<f64> },
    Microseconds { last: Option<Microseconds> },
}

/// Last value of a counter, as in the file and unwrapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Microseconds {
    /// Counter as in the file.
    pub counter: u64,
    /// Counter without its wraps.
    pub unwrapped: u64,
}

/// Last time of a stream, from which another stream of the same device may continue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LastTime {
    /// Time of a column in seconds.
    Seconds(f64),
    /// Time of a counter.
    Microseconds(Microseconds),
}

impl Clock {
    pub(crate) fn new(column: Column) -> Self {
        if column == Column::TimeUs { Self::Microseconds { last: None } } else { Self::Seconds { last: None } }
    }

    /// Returns the last time, if there has been a row.
    pub(crate) fn last(&self) -> Option<LastTime> {
        match self {
            Self::Seconds { last } => last.map(LastTime::Seconds),
            Self::Microseconds { last } => last.map(LastTime::Microseconds),
        }
    }

    /// Continues from the last time of another stream; `false` if that counted in another unit.
    pub(crate) fn go_on(&mut self, from: LastTime) -> bool {
        match (self, from) {
            (Self::Seconds { last }, LastTime::Seconds(time_s)) => *last = Some(time_s),
            (Self::Microseconds { last }, LastTime::Microseconds(us)) => *last = Some(us),
            _ => return false,
        }
        true
    }

    /// Reads the time of a row on the file's clock, s.
    pub(crate) fn read(&mut self, cell: &str) -> Result<f64, Fault> {
        match self {
            Self::Seconds { last } => {
                let now = seconds(cell, *last)?;
                *last = Some(now);
                Ok(now)
            }
            Self::Microseconds { last } => {
                let now = microseconds(cell, *last)?;
                *last = Some(now);
                // Exact up to 2⁵³ µs, 285 years.
                Ok(now.unwrapped as f64 / 1e6)
            }
        }
    }
}

fn seconds(cell: &str, last: Option<f64>) -> Result<f64, Fault> {
    const NAME: &str = Column::TimeS.name();
    let now = crate::cell::number(NAME, cell)?;
    if now.is_nan() {
        return Err(Fault::in_column(NAME, "a time in seconds", quote(cell)));
    }
    match last {
        Some(last) if now <= last => Err(Fault::in_column(NAME, format!("a time after {last} s"), quote(cell)).late()),
        _ => Ok(now),
    }
}

/// Reads a 32-bit counter, which wraps to 0 after 71.6 minutes. A decrease that, modulo 2³², is a step forward of
/// less than an eighth of the range is a wrap, any other is time going backwards.
fn microseconds(cell: &str, last: Option<Microseconds>) -> Result<Microseconds, Fault> {
    const NAME: &str = Column::TimeUs.name();
    let wrong = |_| Fault::in_column(NAME, "a time in whole microseconds", quote(cell));
    let counter: u64 = cell.parse().map_err(wrong)?;
    let Some(last) = last else { return Ok(Microseconds { counter, unwrapped: counter }) };
    let backwards = || Fault::in_column(NAME, format!("a time after {} µs", last.counter), quote(cell)).late();
    let step = match counter.checked_sub(last.counter) {
        Some(step) => step,
        None if last.counter < WRAP_US => counter + WRAP_US - last.counter,
        None => 0,
    };
    if step == 0 || (counter < last.counter && step >= WRAP_US / WRAP_WITHIN) {
        return Err(backwards());
    }
    let unwrapped = last.unwrapped.checked_add(step).ok_or_else(backwards)?;
    Ok(Microseconds { counter, unwrapped })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(column: Column, cells: &[&str]) -> Vec<Option<f64>> {
        let mut clock = Clock::new(column);
        cells.iter().map(|cell| clock.read(cell).ok()).collect()
    }

    #[test]
    fn a_32_bit_counter_may_wrap_several_times() {
        let cells = ["4294967290", "4", "2000000000", "4000000000", "14"];
        let unwrapped: [u64; 5] = [4_294_967_290, 4_294_967_300, 6_294_967_296, 8_294_967_296, 2 * WRAP_US + 14];
        let expected: Vec<_> = unwrapped.iter().map(|us| Some(*us as f64 / 1e6)).collect();
        assert_eq!(times(Column::TimeUs, &cells), expected);
    }

    #[test]
    fn a_counter_that_steps_back_has_not_wrapped() {
        assert_eq!(times(Column::TimeUs, &["1000", "900"])[1], None);
        // A board that was restarted after 40 minutes.
        assert_eq!(times(Column::TimeUs, &["2400000000", "0"])[1], None);
        assert_eq!(times(Column::TimeUs, &["1000", "1000"])[1], None);
        assert_eq!(times(Column::TimeUs, &["5000000000", "4"])[1], None);
        assert_eq!(times(Column::TimeUs, &["5000000000", "5000000001"])[1], Some(5000.000001));
    }

    #[test]
    fn a_counter_goes_on_where_another_stream_ended() {
        let mut clock = Clock::new(Column::TimeUs);
        let last = LastTime::Microseconds(Microseconds { counter: 4_294_967_290, unwrapped: 2 * WRAP_US - 6 });
        assert!(clock.go_on(last) && clock.last() == Some(last));
        assert_eq!(clock.read("4").ok(), Some((2 * WRAP_US + 4) as f64 / 1e6));
        assert!(!clock.go_on(LastTime::Seconds(3.0)));
    }

    #[test]
    fn seconds_increase_and_are_never_missing() {
        assert_eq!(times(Column::TimeS, &["-1.5", "0", "0", "NaN", "", "1"])[..3], [Some(-1.5), Some(0.0), None]);
        assert_eq!(times(Column::TimeS, &["nan"]), [None]);
    }
}
