//! Summary of a calibration, in words.

use ohmstrain_sensor::{
    EstimatorKind, Findings, Limit, Quantity, RecordingSummary, Scores, SensorParams, TemperatureParams, TestedSummary,
};
use serde::Serialize;

use super::number::{fixed, shown, significant};
use super::verdict::{Known, is_better, of_static_curve, percent, verdict};

/// Number of pieces of advice that are printed; the others are only counted.
const PRINTED_ADVICE: usize = 1;
/// Share of the rows below which a tenth of the range is named.
const SELDOM: f64 = 0.04;
/// Ratio of two quantiles of the speed up to which they count as one speed, since they differ by noise alone.
const ONE_SPEED: f64 = 1.1;

/// Summary of a calibration, for people.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let closing = ohmstrain::Closing { file: Some("s.toml"), params: sensor.params(), findings: None, tested: None,
///     calibration_s: Some(1.5), more: "advice" };
/// let written = "s.toml, estimator sign-split, a law of 3 branches; it took 1.5 s".to_owned();
/// assert_eq!(closing.lines().last(), Some(&("Written", written)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Closing<'a> {
    /// Name of its file, if it has one.
    pub file: Option<&'a str>,
    /// The sensor.
    pub params: &'a SensorParams,
    /// Measured quality of the sensor; `None` if it could not be measured.
    pub findings: Option<&'a Findings>,
    /// Quality on held-out rows; `None` if there were none.
    pub tested: Option<&'a Tested>,
    /// Wall-clock time, s, if it was measured.
    pub calibration_s: Option<f64>,
    /// Name of the place where the full advice is.
    pub more: &'a str,
}

/// Scores of rows that a calibration never saw.
///
/// ```
/// fn ratio(tested: &ohmstrain::Tested) -> f64 {
///     tested.filter.rmse / tested.static_cubic.rmse
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tested {
    /// The default estimator's filter.
    pub filter: Scores,
    /// The static cubic.
    pub static_cubic: Scores,
}

impl From<&Tested> for TestedSummary {
    fn from(tested: &Tested) -> Self {
        Self {
            filter_percent_fs: tested.filter.rmse_percent_fs,
            static_cubic_percent_fs: tested.static_cubic.rmse_percent_fs,
            coverage_95_percent: 100.0 * tested.filter.coverage_95.unwrap_or(0.0),
        }
    }
}

impl From<&Tested> for Known {
    fn from(tested: &Tested) -> Self {
        Self::new(&tested.filter, Some(&tested.static_cubic)).widened()
    }
}

impl Closing<'_> {
    /// Returns a sentence on the sensor's quality on held-out rows; `None` if there are none.
    ///
    /// ```
    /// fn print(closing: &ohmstrain::Closing) {
    ///     println!("{}", closing.verdict().unwrap_or_default());
    /// }
    /// ```
    #[must_use]
    pub fn verdict(&self) -> Option<String> {
        let known = self.known();
        let of = if self.params.default_estimator == EstimatorKind::StaticCubic { of_static_curve } else { verdict };
        (!known.is_empty()).then(|| of(&known))
    }

    /// True if all its known errors are below 0.9 times the static cubic's; `None` if none are known, or if the default is the static cubic.
    ///
    /// ```
    /// fn warn(closing: &ohmstrain::Closing) {
    ///     if closing.is_better() == Some(false) {
    ///         println!("no better than a static curve");
    ///     }
    /// }
    /// ```
    #[must_use]
    pub fn is_better(&self) -> Option<bool> {
        if self.params.default_estimator == EstimatorKind::StaticCubic { None } else { is_better(&self.known()) }
    }

    /// Returns a warning if the estimator was `chosen`, and is no better than a static curve.
    ///
    /// ```
    /// fn warn(closing: &ohmstrain::Closing, chosen: Option<ohmstrain::EstimatorKind>) {
    ///     closing.warning(chosen).iter().for_each(|warning| println!("{warning}"));
    /// }
    /// ```
    #[must_use]
    pub fn warning(&self, chosen: Option<EstimatorKind>) -> Option<String> {
        let chosen = chosen.filter(|chosen| *chosen != EstimatorKind::Corrected && self.is_better() == Some(false))?;
        let (file, name) = (self.file.unwrap_or("the sensor"), chosen.name());
        Some(format!(
            "{file}: {name} is no better than a static curve; without --estimator, calibrate tries others and a correction"
        ))
    }

    /// Describes by how much intervals are wider than the estimator's, to cover errors on held-out rows.
    fn widened(&self) -> Option<String> {
        let sd = self.params.unstated.filter_sd;
        let share = 100.0 * sd / self.params.limits.span();
        (share >= 0.05).then(|| format!("intervals are widened by a deviation of {} for it", percent(share)))
    }

    fn known(&self) -> Vec<Known> {
        let left_out = self.findings.map(|found| Known::new(&found.filter, Some(&found.static_cubic)));
        left_out.into_iter().chain(self.tested.map(Known::from)).collect()
    }

    /// Returns the facts about the calibration for a report: names and texts.
    ///
    /// ```
    /// fn print(closing: &ohmstrain::Closing) {
    ///     closing.facts().iter().for_each(|(name, text)| println!("{name}: {text}"));
    /// }
    /// ```
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let tested = self.tested.map(|tested| ("Tested", error_in_test(tested)));
        let widened = self.widened().map(|widened| ("Widened", widened));
        let Some(found) = self.findings else { return tested.into_iter().chain(widened).collect() };
        let next = if found.advice.is_empty() { advice(&found.advice, self.more) } else { found.advice.join("; ") };
        let facts = [
            ("Seen", seen(&found.seen, self.params.quantity)),
            ("Limited by", limited_by_in_full(found)),
            ("Record next", next),
        ];
        [("Left out", error_and_coverage(found))].into_iter().chain(tested).chain(widened).chain(facts).collect()
    }

    /// Returns the lines that a program prints at the end: names and sentences, eight at most.
    ///
    /// ```
    /// fn print(closing: &ohmstrain::Closing) {
    ///     closing.lines().iter().for_each(|(name, text)| println!("{name:13}{text}"));
    /// }
    /// ```
    #[must_use]
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = Vec::from_iter(self.verdict().map(|verdict| ("Verdict", verdict)));
        lines.push(match self.findings {
            None => ("Left out", "nothing could be scored on parts of the recordings left out".to_owned()),
            Some(found) => ("Left out", error_and_coverage(found)),
        });
        lines.extend(self.tested.map(|tested| ("Tested", error_in_test(tested))));
        if let (Some(widened), Some((_, measured))) = (self.widened(), lines.last_mut()) {
            measured.push_str("; ");
            measured.push_str(&widened);
        }
        lines.extend(self.params.temperature.map(|effect| ("Temperature", of_temperature(&effect))));
        if let Some(found) = self.findings {
            lines.push(("Seen", seen(&found.seen, self.params.quantity)));
            lines.push(("Limited by", limited_by(found)));
            lines.push(("Record next", advice(&found.advice, self.more)));
        }
        let (estimator, branches) = (self.params.default_estimator.name(), self.params.law.branches.len());
        let law = if branches == 1 { "1 branch".into() } else { format!("{branches} branches") };
        let took = self.calibration_s.map(|taken| format!("; it took {} s", fixed(taken, i32::from(taken < 9.95))));
        let made = format!("estimator {estimator}, a law of {law}{}", took.unwrap_or_default());
        lines.push(match self.file {
            Some(file) => ("Written", format!("{file}, {made}")),
            None => ("Sensor", made),
        });
        lines
    }
}

fn error_and_coverage(found: &Findings) -> String {
    let error = |scores: &Scores| percent(scores.rmse_percent_fs);
    let smoother = found.smoother.map_or_else(String::new, |scores| format!(" (smoothed {})", error(&scores)));
    let covered = found.filter.coverage_95.unwrap_or(0.0);
    let width = found.filter.width_95_percent_fs.unwrap_or(0.0);
    format!(
        "{} of full scale{smoother} on held-out quarters, static cubic {}; the 95 % interval, {} wide, holds {} of \
         their rows",
        error(&found.filter),
        error(&found.static_cubic),
        percent(width),
        percent(100.0 * covered)
    )
}

/// Describes the effect of temperature that is removed from the readings.
fn of_temperature(effect: &TemperatureParams) -> String {
    let per_k = |value: f64, sd: f64| format!("{} ± {} %/K", significant(100.0 * value, 2), significant(100.0 * sd, 1));
    let gain = (effect.gain_per_k != 0.0)
        .then(|| format!(", change with strain {}", per_k(effect.gain_per_k, effect.gain_per_k_sd)));
    format!(
        "R0 {}{}; {} to {} °C, converted to {} °C",
        per_k(effect.rest_per_k, effect.rest_per_k_sd),
        gain.unwrap_or_default(),
        significant(effect.lower_c, 3),
        significant(effect.upper_c, 3),
        significant(effect.reference_c, 3)
    )
}

fn error_in_test(tested: &Tested) -> String {
    format!(
        "{} of full scale on rows kept from it, static cubic {}; the interval holds {}",
        percent(tested.filter.rmse_percent_fs),
        percent(tested.static_cubic.rmse_percent_fs),
        percent(100.0 * tested.filter.coverage_95.unwrap_or(0.0))
    )
}

/// Describes the range, its least visited tenth, speeds and holds.
fn seen(seen: &RecordingSummary, quantity: Quantity) -> String {
    let (scale, unit) = shown(quantity);
    let number = |x: f64| significant(scale * x, 3).replace('−', "-");
    let (low, span) = (seen.range.lower, seen.range.span());
    let edge = |tenth: usize| number(low + tenth as f64 / seen.tenths.len() as f64 * span);
    let least = seen.tenths.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
    let seldom = least.filter(|(_, share)| **share < SELDOM).map(|(tenth, share)| {
        format!(" (least often {} to {}{unit}: {} of the rows)", edge(tenth), edge(tenth + 1), percent(100.0 * share))
    });
    let holds = if seen.longest_hold_s > 0.0 {
        format!("holds to {} s", significant(seen.longest_hold_s, 2))
    } else {
        "no holds".into()
    };
    let (slow, fast) = (seen.quartile_speeds.0, seen.quartile_speeds.1.min(seen.fastest_rate));
    let usual = if fast < ONE_SPEED * slow {
        format!("about {}", significant(scale * f64::midpoint(slow, fast), 2))
    } else {
        format!("{} to {}", number(slow), number(fast))
    };
    let fastest = if seen.fastest_rate > ONE_SPEED * fast {
        format!(", seldom over {}", number(seen.fastest_rate))
    } else {
        String::new()
    };
    format!(
        "{} {} to {}{unit}{}; mostly {usual}{fastest}{unit}/s; {holds}; {} s",
        quantity.name().trim_end_matches("_deg"),
        number(low),
        number(seen.range.upper),
        seldom.unwrap_or_default(),
        significant(seen.longest_s, 3)
    )
}

/// Lists the sources of the error with their shares, the largest first, in one line of a terminal.
fn limited_by(found: &Findings) -> String {
    let whole = |share: f64| fixed(100.0 * share, 0);
    let share = |(limit, share): (Limit, f64)| format!("{} {} %", limit.name(), whole(share));
    let shares = found.budget.shares().sorted().map(share).join(", ");
    format!("{shares} of MSE; wrong direction in {} %", whole(found.budget.wrong_rows))
}

/// Lists them together with the numbers behind the shares.
fn limited_by_in_full(found: &Findings) -> String {
    let budget = &found.budget;
    format!(
        "{} of the moving rows; of the readings' range the law misses {}, drift moves {}, noise {}",
        limited_by(found),
        percent(budget.law_percent),
        percent(budget.drift_percent),
        percent(budget.noise_percent)
    )
}

fn advice(advice: &[String], elsewhere: &str) -> String {
    let first = advice.iter().take(PRINTED_ADVICE).cloned().collect::<Vec<_>>().join("; ");
    match advice.len().saturating_sub(PRINTED_ADVICE) {
        _ if advice.is_empty() => "a recording of another day; nothing else would clearly help".into(),
        0 => first,
        more => format!("{first} ({more} more: {elsewhere})"),
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_model::StrainRange;

    use super::*;

    #[test]
    fn one_speed_is_one_number() {
        let with = |quartile_speeds, fastest_rate| {
            let range = StrainRange { lower: 0.0, upper: 0.4 };
            let seen = RecordingSummary {
                range,
                tenths: [0.1; 10],
                quartile_speeds,
                fastest_rate,
                longest_hold_s: 0.0,
                longest_s: 100.0,
                rows: 1000,
            };
            super::seen(&seen, Quantity::Strain)
        };
        assert_eq!(with((0.0407, 0.0417), 0.0418), "strain 0 to 40 %; mostly about 4.1 %/s; no holds; 100 s");
        assert_eq!(with((0.0407, 0.0417), 0.0405), "strain 0 to 40 %; mostly about 4.1 %/s; no holds; 100 s");
        assert_eq!(
            with((0.0407, 0.0417), 0.08),
            "strain 0 to 40 %; mostly about 4.1, seldom over 8 %/s; no holds; 100 s"
        );
        assert_eq!(with((0.01, 0.04), 0.042), "strain 0 to 40 %; mostly 1 to 4 %/s; no holds; 100 s");
        assert_eq!(with((0.01, 0.04), 0.05), "strain 0 to 40 %; mostly 1 to 4, seldom over 5 %/s; no holds; 100 s");
    }
}
