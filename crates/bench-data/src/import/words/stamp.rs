use chrono::{Datelike, NaiveDate};

const SECOND: i128 = 1_000_000_000;
pub(crate) const DAY: i128 = 86_400 * SECOND;
/// Latest time of day, which may be west of Greenwich, in UTC.
const LONGEST_DAY: i128 = 2 * DAY;
/// Most hours or minutes of an elapsed time.
const MOST_ELAPSED: i128 = 9999;

/// Order of the parts of a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Order {
    /// `2024-05-01`.
    Iso,
    /// `01.05.2024`: the first of May.
    Dmy,
    /// `05/01/2024`: the first of May.
    Mdy,
}

impl Order {
    pub(crate) const ALL: [Self; 3] = [Self::Iso, Self::Dmy, Self::Mdy];

    /// Returns the name of such dates among the units of time.
    pub(crate) const fn unit(self) -> &'static str {
        match self {
            Self::Iso => "iso",
            Self::Dmy => "dmy",
            Self::Mdy => "mdy",
        }
    }
}

/// A text with a date, a time of day or both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stamp {
    /// Nanoseconds since a fixed day, or since midnight if there is no date; UTC if the text has an offset.
    pub nanoseconds: i128,
    pub has_date: bool,
    pub has_time: bool,
}

/// Labels of whole and of fractional seconds, and the number of digits of the fraction.
pub(crate) const SPLIT_SECONDS: [(&str, &str, usize); 11] = [
    ("sec", "ms", 3),
    ("sec", "msec", 3),
    ("sec", "nanosec", 9),
    ("sec", "nsec", 9),
    ("secs", "nsecs", 9),
    ("tv_sec", "tv_nsec", 9),
    ("seconds", "nanoseconds", 9),
    ("sec", "usec", 6),
    ("secs", "usecs", 6),
    ("tv_sec", "tv_usec", 6),
    ("seconds", "microseconds", 6),
];

/// Reads a date, a time of day or both. Names of months are not supported, so that no language is preferred.
pub(crate) fn stamp(text: &str, order: Order) -> Option<Stamp> {
    let text = text.trim();
    if !may_be_stamp(text.as_bytes()) {
        return None;
    }
    // pandas writes elapsed times as `0 days 00:00:00.050000`.
    if let Some((days, time)) = text.split_once(" days ") {
        let days: u16 = days.parse().ok()?;
        return Some(Stamp {
            nanoseconds: i128::from(days) * DAY + time_of_day(time)?,
            has_date: false,
            has_time: true,
        });
    }
    let (date, time) = date_and_time(text);
    let days = match date {
        Some(date) => i128::from(days(date.trim_end_matches(','), order)?),
        None => 0,
    };
    let seconds = match time {
        Some(time) => time_of_day(time.trim())?,
        None => 0,
    };
    if date.is_some() && seconds > LONGEST_DAY {
        return None;
    }
    Some(Stamp { nanoseconds: days * DAY + seconds, has_date: date.is_some(), has_time: time.is_some() })
}

/// True if a text begins with a digit and contains characters of dates or times of day: two marks between the parts of a date, or a mark
/// within or before a time of day. Most cells are numbers; this check rejects them quickly.
fn may_be_stamp(text: &[u8]) -> bool {
    let marks = || text.iter().filter(|byte| matches!(byte, b'-' | b'/' | b'.')).count();
    let has_time = || text.iter().any(|byte| matches!(byte, b':' | b'_' | b'T' | b' '));
    text.first().is_some_and(u8::is_ascii_digit) && (marks() >= 2 || has_time())
}

/// Returns the date and the time of day of a text, one of which may be missing: `2024-05-01 10:30`, `2024/05/01/10:30`, `2024-05-01-10:30`,
/// `2024-05-01_10-30-00`.
pub(crate) fn date_and_time(text: &str) -> (Option<&str>, Option<&str>) {
    match text.trim().split_once(['T', ' ', '_']) {
        Some((date, time)) if !date.contains(':') => (Some(date), Some(time)),
        _ => match text.find(':') {
            Some(colon) => match text[..colon].rfind(['-', '/']) {
                Some(end) => (Some(&text[..end]), Some(&text[end + 1..])),
                None => (None, Some(text)),
            },
            None => (Some(text), None),
        },
    }
}

fn parts(date: &str) -> Option<[u32; 3]> {
    let mut parts = date.split(['-', '/', '.']);
    let mut next = || parts.next().filter(|part| part.len() <= 4)?.parse().ok();
    let out = [next()?, next()?, next()?];
    parts.next().is_none().then_some(out)
}

fn days(date: &str, order: Order) -> Option<i32> {
    // `20240501`.
    let is_bare = date.len() == 8 && date.bytes().all(|byte| byte.is_ascii_digit()) && order == Order::Iso;
    let bare = || Some([date[..4].parse().ok()?, date[4..6].parse().ok()?, date[6..].parse().ok()?]);
    let [a, b, c] = if is_bare { bare() } else { parts(date) }?;
    let (year, month, day) = match order {
        Order::Iso => (a, b, c),
        Order::Dmy => (c, b, a),
        Order::Mdy => (c, a, b),
    };
    (year >= 1000).then(|| NaiveDate::from_ymd_opt(year as i32, month, day))?.map(|date| date.num_days_from_ce())
}

/// Reads `12:30:01.25`, `12:30:01:250`, `12:30`, `1:30:01 PM`, `12:30:01+02:00`, `12:30:01Z`; returns nanoseconds since midnight UTC.
/// Spreadsheets write minutes and seconds as `01:30.5`. File names contain `12-30-01` and `123001`.
fn time_of_day(time: &str) -> Option<i128> {
    let as_in_names = in_a_name(time);
    let time = as_in_names.as_deref().unwrap_or(time);
    let (time, zone) = match time.find(['Z', '+', '-']) {
        Some(at) => (&time[..at], zone(&time[at..])?),
        None => (time, 0),
    };
    let lower = time.trim().to_ascii_lowercase();
    let (clock, half) = match (lower.strip_suffix("am"), lower.strip_suffix("pm")) {
        (Some(clock), _) => (clock.trim(), Some(0)),
        (_, Some(clock)) => (clock.trim(), Some(12)),
        _ => (lower.as_str(), None),
    };
    // Elapsed times may have more hours than a day, or more minutes than an hour.
    let (hours, minutes, seconds, thousandths, most) = match clock.split(':').collect::<Vec<_>>()[..] {
        [minutes, seconds] if seconds.contains(['.', ',']) => ("0", minutes, seconds, "", (0, MOST_ELAPSED)),
        [hours, minutes] => (hours, minutes, "0", "", (24, 59)),
        [hours, minutes, seconds] if half.is_none() => (hours, minutes, seconds, "", (MOST_ELAPSED, 59)),
        [hours, minutes, seconds] => (hours, minutes, seconds, "", (24, 59)),
        [hours, minutes, seconds, part] if part.len() == 3 && seconds.len() == 2 => {
            (hours, minutes, seconds, part, (24, 59))
        }
        _ => return None,
    };
    let mut hours: i128 = hours.parse().ok()?;
    let minutes: i128 = minutes.parse().ok()?;
    let thousandths: i128 = if thousandths.is_empty() { 0 } else { thousandths.parse().ok()? };
    let nanoseconds = nanoseconds(seconds)? + thousandths * SECOND / 1000;
    if hours > most.0 || minutes > most.1 || nanoseconds >= 61 * SECOND {
        return None;
    }
    if let Some(half) = half {
        hours = hours % 12 + half;
    }
    Some((hours * 60 + minutes - zone) * 60 * SECOND + nanoseconds)
}

/// Adds colons to a time of day without them.
fn in_a_name(time: &str) -> Option<String> {
    let (clock, fraction) = time.split_at(time.find('.').unwrap_or(time.len()));
    let is_digits = |part: &&str| part.len() == 2 && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts: Vec<&str> = match clock.split('-').collect::<Vec<_>>()[..] {
        [all] if all.len() == 6 && all.is_ascii() => vec![&all[..2], &all[2..4], &all[4..]],
        [hours, minutes, seconds] => vec![hours, minutes, seconds],
        _ => return None,
    };
    parts.iter().all(is_digits).then(|| parts.join(":") + fraction)
}

/// Returns minutes east of Greenwich.
fn zone(text: &str) -> Option<i128> {
    if text == "Z" {
        return Some(0);
    }
    let digits: String = text[1..].chars().filter(|c| *c != ':').collect();
    let minutes = match digits.len() {
        2 => digits.parse::<i128>().ok()? * 60,
        4 => digits.get(..2)?.parse::<i128>().ok()? * 60 + digits.get(2..)?.parse::<i128>().ok()?,
        _ => return None,
    };
    Some(if text.starts_with('-') { -minutes } else { minutes })
}

fn nanoseconds(seconds: &str) -> Option<i128> {
    let (whole, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, ""));
    let is_digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || whole.len() > 2 || !is_digits(whole) || !is_digits(fraction) {
        return None;
    }
    let fraction: String = fraction.chars().chain("000000000".chars()).take(9).collect();
    Some(whole.parse::<i128>().ok()? * SECOND + fraction.parse::<i128>().ok()?)
}

/// True if a cell is a date or a time of day in some order.
pub(crate) fn is_stamp(text: &str) -> bool {
    Order::ALL.into_iter().any(|order| stamp(text, order).is_some())
}

/// Returns the orders in which all cells are dates or times of day; none if some are not.
pub(crate) fn orders<'a>(cells: impl Iterator<Item = &'a str> + Clone) -> Vec<Order> {
    let all = |order: &Order| {
        let mut filled = cells.clone().filter(|cell| !cell.trim().is_empty()).peekable();
        filled.peek().is_some() && filled.all(|cell| stamp(cell, *order).is_some())
    };
    Order::ALL.into_iter().filter(all).collect()
}

/// True if the parts of a date are separated by points, as in countries where the day comes first.
pub(crate) fn has_points(text: &str) -> bool {
    date_and_time(text).0.is_some_and(|date| date.matches('.').count() == 2)
}

/// Continues times of day past midnight.
pub(crate) fn past_midnight(stamps: &mut [Option<i128>]) {
    let (mut days, mut last) = (0, None);
    for stamp in stamps.iter_mut().flatten() {
        let bare = *stamp;
        if last.is_some_and(|last: i128| last - bare > DAY / 2) {
            days += DAY;
        }
        last = Some(bare);
        *stamp += days;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(text: &str, order: Order) -> Option<f64> {
        stamp(text, order).map(|stamp| stamp.nanoseconds as f64 / 1e9)
    }

    #[test]
    fn the_same_moment_in_several_spellings() {
        let moment = seconds("2024-05-01T10:30:01.5Z", Order::Iso);
        assert!(moment.is_some());
        for text in [
            "2024-05-01 10:30:01,5",
            "2024/05/01 10:30:01.500",
            "2024-05-01T12:30:01.5+02:00",
            "2024/05/01/10:30:01.5",
            "2024-05-01-10:30:01.50",
            "2024-05-01_10:30:01.5",
            "2024-05-01_10-30-01.5",
            "20240501_103001.5",
            "20240501T10:30:01.5",
        ] {
            assert_eq!(seconds(text, Order::Iso), moment, "{text}");
        }
        assert_eq!(seconds("1.5.2024 10:30:01.5", Order::Dmy), moment);
        assert_eq!(seconds("05/01/2024 10:30:01.5 AM", Order::Mdy), moment);
        assert_eq!(seconds("05/01/2024 10:30:01:500", Order::Mdy), moment);
        assert_eq!(seconds("01:30.5", Order::Iso), Some(90.5));
        assert_eq!(seconds("01:30", Order::Iso), Some(5400.0));
        assert_eq!(seconds("61:30.5", Order::Iso), Some(3690.5));
        assert_eq!(seconds("25:00:01", Order::Iso), Some(90_001.0));
        assert_eq!(seconds("25:00:01 pm", Order::Iso), None);
        assert_eq!(seconds("61:30", Order::Iso), None);
        assert_eq!(seconds("1 days 00:00:01.050000", Order::Iso), Some(86_401.05));
    }

    #[test]
    fn times_of_day_pass_midnight() {
        let mut stamps: Vec<Option<i128>> = ["23:59:59.5", "0:00:00.5"]
            .iter()
            .map(|text| stamp(text, Order::Iso).map(|stamp| stamp.nanoseconds))
            .collect();
        past_midnight(&mut stamps);
        assert_eq!(stamps[1].unwrap() - stamps[0].unwrap(), SECOND);
    }

    #[test]
    fn numbers_and_words_are_no_stamps() {
        for text in [
            "1.5",
            "1600",
            "-5",
            "12:30:99",
            "2024-13-01",
            "a:b",
            "1:2:3:4",
            "12.5.1",
            "12:30:01+0é1",
            "1_5",
            "12345678",
            "7T",
            "1-2-3-4:5",
        ] {
            assert!(!is_stamp(text), "{text}");
        }
    }

    #[test]
    fn the_order_of_day_and_month_may_stay_open() {
        let open = ["05/01/2024 10:00", "06/01/2024 10:00"];
        assert_eq!(orders(open.into_iter()), [Order::Dmy, Order::Mdy]);
        let determined = ["05/01/2024 10:00", "05/13/2024 10:00"];
        assert_eq!(orders(determined.into_iter()), [Order::Mdy]);
    }
}
