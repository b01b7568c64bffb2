use crate::clock::WRAP_WITHIN;
use crate::error::{Fault, quote};
use crate::import::error::ImportError;
use crate::import::roles::{Channel, Clock};
use crate::import::series::values::Values;
use crate::import::table::Table;
use crate::import::words::stamp::{DAY, Order, Stamp, past_midnight, stamp};
use crate::import::words::{Scale, is_missing, nanoseconds};

/// Least time, s, that is not counted from the start of a recording, but from 1970 or, in days, from the end of 1899.
const DATES_FROM_S: f64 = 1e8;
/// Days from the start of the calendar to 1970 and to the end of 1899.
const UNIX_DAY: i128 = 719_163;
const SHEET_DAY: i128 = 693_594;
/// Range of a 32-bit counter.
const WRAP: f64 = 4_294_967_296.0;

/// Times of a table's rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Times {
    /// Times, s; NaN where missing. Dates, times of day and times since 1970 are counted from the first.
    pub seconds: Vec<f64>,
    /// The first date or time of day, ns, and its text in the file.
    pub zero: Option<(i128, String)>,
    /// Number of restarts of a 32-bit counter.
    pub wraps: usize,
}

impl Times {
    pub(crate) fn read(tables: &[Table], clock: &Clock, own_missing: &[String]) -> Result<Self, ImportError> {
        match clock {
            Clock::Rate { hz, file } => {
                let seconds = (0..tables[*file].len()).map(|row| row as f64 / hz).collect();
                Ok(Self { seconds, ..Self::default() })
            }
            Clock::Column(channel) if channel.unit.scale == Scale::Stamp => stamps(tables, channel, own_missing),
            Clock::Column(channel) => counts(tables, channel, own_missing),
        }
    }
}

fn counts(tables: &[Table], channel: &Channel, own_missing: &[String]) -> Result<Times, ImportError> {
    let Values { values: mut seconds, .. } = Values::read(tables, channel, own_missing)?;
    if let Some(row) = seconds.iter().position(|time| !time.is_nan()).filter(|row| seconds[*row] >= DATES_FROM_S) {
        return Ok(since_the_first(tables, channel, seconds, row));
    }
    let wrap_s = match channel.unit.name {
        "ms" => WRAP / 1e3,
        "us" => WRAP / 1e6,
        _ => return Ok(Times { seconds, ..Times::default() }),
    };
    // Like the trace's own `time_us`: a decrease that, modulo 2³², is a short step forward is a wrap.
    let unit_s = wrap_s / WRAP;
    let (mut wraps, mut last) = (0_u32, f64::NAN);
    for value in &mut seconds {
        let bare = *value;
        if bare.is_nan() {
            continue;
        }
        if bare < last && last < wrap_s && bare + wrap_s - last < wrap_s / WRAP_WITHIN as f64 {
            wraps += 1;
        }
        last = bare;
        if wraps > 0 {
            // Counts are whole numbers: their sum is exact, and divided once.
            *value = ((bare / unit_s).round() + f64::from(wraps) * WRAP) / (1.0 / unit_s).round();
        }
    }
    Ok(Times { seconds, wraps: wraps as usize, ..Times::default() })
}

/// Returns times since the first of them, in row `first`, with the file's digits if its unit is a power of ten.
fn since_the_first(tables: &[Table], channel: &Channel, mut seconds: Vec<f64>, first: usize) -> Times {
    let table = &tables[channel.place.file];
    let cells = &table.columns[channel.place.column].cells;
    let exact = |row: usize| match channel.unit.scale {
        Scale::Shift(shift) => nanoseconds(cells.get(row), table.layout.decimal, shift),
        _ => None,
    };
    let day = if channel.unit.name == "days" { SHEET_DAY } else { UNIX_DAY };
    let (origin, origin_s) = (exact(first), seconds[first]);
    for (row, time) in seconds.iter_mut().enumerate().filter(|(_, time)| !time.is_nan()) {
        *time = match (exact(row), origin) {
            (Some(moment), Some(origin)) => (moment - origin) as f64 / 1e9,
            _ => *time - origin_s,
        };
    }
    let zero = day * DAY + origin.unwrap_or((origin_s * 1e9) as i128);
    Times { seconds, zero: Some((zero, cells.get(first).to_owned())), wraps: 0 }
}

fn stamps(tables: &[Table], channel: &Channel, own_missing: &[String]) -> Result<Times, ImportError> {
    let table = &tables[channel.place.file];
    let order = Order::ALL.into_iter().find(|order| order.unit() == channel.unit.name).unwrap_or(Order::Iso);
    let cells = &table.columns[channel.place.column].cells;
    let mut found: Vec<Option<i128>> = Vec::with_capacity(cells.len());
    let mut first_read: Option<Stamp> = None;
    for (row, cell) in cells.iter().enumerate() {
        let read = stamp(cell, order);
        if read.is_none() && !is_missing(cell, own_missing) {
            let expected = format!("a date or a time of day in column {}", table.name(channel.place.column));
            return Err(ImportError::content(&table.file, table.lines[row], Fault::new(expected, quote(cell))));
        }
        if let (Some(first), Some(read)) = (first_read, read)
            && first.has_date != read.has_date
        {
            let expected =
                if first.has_date { "a date as in the rows above" } else { "a time of day as in the rows above" };
            return Err(ImportError::content(&table.file, table.lines[row], Fault::new(expected, quote(cell))));
        }
        first_read = first_read.or(read);
        found.push(read.map(|read| read.nanoseconds));
    }
    if !first_read.is_some_and(|first| first.has_date) {
        past_midnight(&mut found);
    }
    let first = found.iter().position(Option::is_some);
    let zero = first.and_then(|row| Some((found[row]?, cells.get(row).to_owned())));
    let origin = zero.as_ref().map_or(0, |(zero, _)| *zero);
    let since = |moment: Option<i128>| moment.map_or(f64::NAN, |moment| (moment - origin) as f64 / 1e9);
    Ok(Times { seconds: found.into_iter().map(since).collect(), zero, wraps: 0 })
}
