//! What a calibration came to, in words.

use ohmstrain_calib::{Findings, Limit, Quantity, Scores, Seen, SensorParams};

use crate::number::{fixed, significant};
use crate::verdict::{percent, verdict};

/// Columns of a terminal that lines keep within, and of the words before them.
const COLUMNS: usize = 100;
const HEAD: usize = 13;
/// A percent sign with its space and a mark behind it.
const SIGN: usize = 3;
/// Advice that is printed; the rest is counted.
const PRINTED_ADVICE: usize = 1;
/// A tenth of the range with a smaller share of the rows than this is named.
const SELDOM: f64 = 0.04;

/// What a calibration came to, for people.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let closing = ohmstrain::Closing { file: Some("s.toml"), params: sensor.params(), findings: None, calibration_s: 1.5 };
/// assert!(closing.text().ends_with("Written      s.toml, estimator sign-split, a law of 3 branches; it took 1.5 s\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Closing<'a> {
    /// The file that it is in, if it is in one.
    pub file: Option<&'a str>,
    /// The sensor.
    pub params: &'a SensorParams,
    /// What it is worth; `None` if that could not be told.
    pub findings: Option<&'a Findings>,
    /// Wall-clock time, s.
    pub calibration_s: f64,
}

impl Closing<'_> {
    /// What a report says of the calibration: names and texts.
    ///
    /// ```
    /// fn print(closing: &ohmstrain::Closing) {
    ///     closing.facts().iter().for_each(|(name, text)| println!("{name}: {text}"));
    /// }
    /// ```
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let Some(found) = self.findings else { return vec![] };
        let next = if found.advice.is_empty() { advice(&found.advice) } else { found.advice.join("; ") };
        vec![
            ("Left out", error_and_coverage(found)),
            ("Seen", seen(&found.seen, self.params.quantity)),
            ("Limited by", limited_by(found)),
            ("Record next", next),
        ]
    }

    /// At most ten lines of a hundred columns.
    ///
    /// ```
    /// fn print(closing: &ohmstrain::Closing) {
    ///     print!("{}", closing.text());
    /// }
    /// ```
    #[must_use]
    pub fn text(&self) -> String {
        let mut lines = Lines::default();
        match self.findings {
            None => lines.add("Left out", "nothing could be scored on parts of the recordings left out"),
            Some(found) => {
                lines.add("Verdict", &verdict(&found.filter, Some(&found.static_cubic)));
                lines.add("Left out", &error_and_coverage(found));
                lines.add("Seen", &seen(&found.seen, self.params.quantity));
                lines.add("Limited by", &limited_by(found));
                lines.add("Record next", &advice(&found.advice));
            }
        }
        let (estimator, branches) = (self.params.default_estimator.name(), self.params.law.branches.len());
        let law = if branches == 1 { "1 branch".into() } else { format!("{branches} branches") };
        let seconds = fixed(self.calibration_s, i32::from(self.calibration_s < 9.95));
        let made = format!("estimator {estimator}, a law of {law}; it took {seconds} s");
        match self.file {
            Some(file) => lines.add("Written", &format!("{file}, {made}")),
            None => lines.add("Sensor", &made),
        }
        lines.text
    }
}

/// Lines with a word before them, wrapped.
#[derive(Default)]
struct Lines {
    text: String,
}

impl Lines {
    fn add(&mut self, head: &str, body: &str) {
        let mut line = format!("{head:HEAD$}");
        for word in body.split(' ') {
            let has_word = line.len() > HEAD;
            // A number stays with its percent sign.
            let is_sign = word.starts_with('%');
            if has_word && !is_sign && line.chars().count() + 1 + word.chars().count() + SIGN > COLUMNS {
                self.text += &line;
                self.text.push('\n');
                line = " ".repeat(HEAD);
            } else if has_word {
                line.push(' ');
            }
            line += word;
        }
        self.text += &line;
        self.text.push('\n');
    }
}

fn error_and_coverage(found: &Findings) -> String {
    let error = |scores: &Scores| percent(scores.rmse_percent_fs);
    let smoother = found.smoother.map_or_else(String::new, |scores| format!(" (smoothed {})", error(&scores)));
    let covered = found.filter.coverage_95.unwrap_or(0.0);
    let width = found.filter.width_95_percent_fs.unwrap_or(0.0);
    format!(
        "{} of full scale{smoother} on quarters not fitted to, static cubic {}; the 95 % interval, {} wide, holds {} of \
         their rows",
        error(&found.filter),
        error(&found.static_cubic),
        percent(width),
        percent(100.0 * covered)
    )
}

/// Range, gaps in it, speeds and holds.
fn seen(seen: &Seen, quantity: Quantity) -> String {
    let (scale, unit) = match quantity {
        Quantity::Strain => (100.0, " %"),
        Quantity::AngleDeg => (1.0, "°"),
    };
    let number = |x: f64| significant(scale * x, 3).replace('−', "-");
    let (low, span) = (seen.range.lower, seen.range.span());
    let edge = |tenth: usize| number(low + tenth as f64 / seen.tenths.len() as f64 * span);
    let least = seen.tenths.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
    let seldom = least.filter(|(_, share)| **share < SELDOM).map(|(tenth, share)| {
        format!(" (least often {} to {}{unit}: {} of the rows)", edge(tenth), edge(tenth + 1), percent(100.0 * share))
    });
    let holds = if seen.longest_hold_s > 0.0 {
        format!("holds up to {} s", significant(seen.longest_hold_s, 2))
    } else {
        "no holds".into()
    };
    format!(
        "{} {} to {}{unit}{}; mostly {} to {}{unit}/s, {}{unit}/s at most; {holds}; {} s",
        quantity.name().trim_end_matches("_deg"),
        number(low),
        number(seen.range.upper),
        seldom.unwrap_or_default(),
        number(seen.quartile_speeds.0),
        number(seen.quartile_speeds.1),
        number(seen.fastest_rate),
        significant(seen.longest_s, 3)
    )
}

/// What makes the error.
fn limited_by(found: &Findings) -> String {
    let budget = &found.budget;
    let parts = [
        (Limit::Law, "law", budget.law_percent),
        (Limit::Drift, "drift", budget.drift_percent),
        (Limit::Noise, "noise", budget.noise_percent),
    ];
    let wrong = percent(100.0 * budget.wrong_rows);
    let size = |(_, name, percent_of_range): &(Limit, &str, f64)| format!("{name} {}", percent(*percent_of_range));
    let (first, others): (Vec<_>, Vec<_>) = parts.iter().partition(|part| part.0 == budget.limit());
    let sizes = first.into_iter().chain(others).map(size).collect::<Vec<_>>().join(", ");
    if budget.limit() == Limit::Direction {
        format!("direction (wrong in {wrong}); {sizes} of the readings' range")
    } else {
        format!("{sizes} of the readings' range; direction wrong in {wrong}")
    }
}

fn advice(advice: &[String]) -> String {
    let first = advice.iter().take(PRINTED_ADVICE).cloned().collect::<Vec<_>>().join("; ");
    match advice.len().saturating_sub(PRINTED_ADVICE) {
        _ if advice.is_empty() => "another recording of another day: nothing stands out in this one".into(),
        0 => first,
        more => format!("{first} ({more} more: --explain)"),
    }
}
