//! Scores in words.

use ohmstrain_sensor::{Scores, Summary};

use super::number::fixed;

/// Ratios to the static cubic's error below which an estimate is clearly better, and better.
const CLEARLY_BETTER: f64 = 0.5;
const BETTER: f64 = 0.9;
/// Smallest coverage of 95 % intervals that counts as right.
const COVERED: f64 = 0.9;
/// Mean width of 95 % intervals, in percent of full scale, above which they carry little information: the standard deviation of a
/// constant guess in the middle of an evenly used range gives 113.
const WIDE: f64 = 60.0;

/// Scores of an estimate on some rows; errors in percent of full scale. For a calibrated sensor they come from its summary.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// use ohmstrain::verdict::{Known, is_better, verdict};
///
/// let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let known: Vec<Known> = sensor.params().summary.iter().map(Known::from).collect();
/// println!("{} ({:?})", verdict(&known), is_better(&known));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Known {
    error: f64,
    /// Error of the static cubic, if there is one.
    static_cubic: Option<f64>,
    /// Share of the rows, 0 to 1, that lie in the 95 % interval.
    covered: f64,
    width: f64,
    /// True if intervals were widened afterwards, until they held these rows.
    is_widened: bool,
}

impl Known {
    /// Creates it from scores, and those of the static cubic on the same rows.
    ///
    /// ```
    /// use ohmstrain::verdict::{Known, is_better};
    /// use ohmstrain::{ScoredRow, Scores};
    ///
    /// let row = |k: u32, error: f64| {
    ///     let truth = f64::from(k) / 100.0;
    ///     ScoredRow { time_s: f64::from(k), truth, strain: truth + error, sd: Some(0.02) }
    /// };
    /// let scores = |error: f64| ohmstrain::score(&(0..100).map(|k| row(k, error)).collect::<Vec<_>>());
    /// let known = scores(0.01).map(|ours| Known::new(&ours, scores(0.1).as_ref()));
    /// assert_eq!(known.and_then(|known| is_better(&[known])), Some(true));
    /// ```
    pub fn new(scores: &Scores, static_cubic: Option<&Scores>) -> Self {
        Self {
            error: scores.rmse_percent_fs,
            static_cubic: static_cubic.map(|cubic| cubic.rmse_percent_fs),
            covered: scores.coverage_95.unwrap_or(0.0),
            width: scores.width_95_percent_fs.unwrap_or(0.0),
            is_widened: false,
        }
    }

    /// Marks scores as those on which intervals were widened afterwards.
    pub(crate) const fn widened(self) -> Self {
        Self { is_widened: true, ..self }
    }
}

impl From<&Summary> for Known {
    fn from(summary: &Summary) -> Self {
        Self {
            error: summary.left_out_percent_fs,
            static_cubic: Some(summary.static_cubic_percent_fs),
            covered: summary.coverage_95_percent / 100.0,
            width: summary.width_95_percent_fs,
            is_widened: false,
        }
    }
}

/// Returns the largest ratio of an error to the static cubic's; `None` without one.
fn worst_ratio(known: &[Known]) -> Option<f64> {
    let ratios = known.iter().filter_map(|part| part.static_cubic.map(|cubic| part.error / cubic));
    ratios.max_by(f64::total_cmp)
}

/// True if all errors are below 0.9 times the static cubic's; `None` without one.
///
/// ```
/// assert_eq!(ohmstrain::verdict::is_better(&[]), None);
/// ```
#[must_use]
pub fn is_better(known: &[Known]) -> Option<bool> {
    Some(worst_ratio(known)? < BETTER)
}

/// Returns one sentence on the errors and their intervals, by the worst of the scores.
///
/// ```
/// assert_eq!(ohmstrain::verdict::verdict(&[]), "No static curve to compare with; its error bars hold.");
/// ```
pub fn verdict(known: &[Known]) -> String {
    let better = match worst_ratio(known) {
        Some(ratio) if ratio < CLEARLY_BETTER => "Clearly better than a static curve",
        Some(ratio) if ratio < BETTER => "Better than a static curve",
        Some(ratio) if ratio < 1.0 / BETTER => "About as good as a static curve",
        Some(_) => "Worse than a static curve",
        None => "No static curve to compare with",
    };
    format!("{better}; {}.", of_intervals(known))
}

/// Returns the sentence for a sensor that is used with the static curve, by the worst of the scores.
///
/// ```
/// assert_eq!(ohmstrain::verdict::of_static_curve(&[]), "The estimate is a static curve; its error bars hold.");
/// ```
pub fn of_static_curve(known: &[Known]) -> String {
    format!("The estimate is a static curve; {}.", of_intervals(known))
}

fn of_intervals(known: &[Known]) -> &'static str {
    let mut narrow = known.iter().filter(|part| part.covered < COVERED).peekable();
    match (narrow.peek().is_some(), known.iter().any(|part| part.width > WIDE)) {
        (true, _) if narrow.all(|part| part.is_widened) => {
            "its error bars were too narrow on the rows of the test, and have been widened"
        }
        (true, _) => "its error bars are too narrow",
        (false, true) => "its error bars hold, but are wide",
        (false, false) => "its error bars hold",
    }
}

/// Formats a number in percent for people: two digits below ten, whole ones above.
///
/// ```
/// assert_eq!([3.24, 40.2].map(ohmstrain::verdict::percent), ["3.2 %", "40 %"]);
/// ```
pub fn percent(value: f64) -> String {
    fixed(value, i32::from(value.abs() < 9.95)) + " %"
}

#[cfg(all(test, feature = "calibrate"))]
mod tests {
    use ohmstrain_calib::ScoredRow;
    use ohmstrain_sensor::Scores;

    use super::{Known, is_better, percent, verdict};

    fn scores(error: f64, sd: f64) -> Scores {
        let row = |k: u32| {
            let truth = f64::from(k % 11) / 10.0;
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            ScoredRow { time_s: f64::from(k), truth, strain: truth + sign * error, sd: Some(sd) }
        };
        ohmstrain_calib::score(&(0..110).map(row).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn error_and_intervals_are_judged() {
        let part = |error: f64, sd: f64| Known::new(&scores(error, sd), Some(&scores(0.1, 1.0)));
        assert_eq!(verdict(&[part(0.03, 0.03)]), "Clearly better than a static curve; its error bars hold.");
        assert_eq!(verdict(&[part(0.08, 0.01)]), "Better than a static curve; its error bars are too narrow.");
        let wide = "Worse than a static curve; its error bars hold, but are wide.";
        assert_eq!(verdict(&[part(0.2, 0.3)]), wide);
        assert!(verdict(&[Known::new(&scores(0.1, 0.1), None)]).starts_with("No static curve"));
    }

    #[test]
    fn the_worst_part_counts() {
        let part = |error: f64, sd: f64| Known::new(&scores(error, sd), Some(&scores(0.1, 1.0)));
        let worst = "Worse than a static curve; its error bars are too narrow.";
        assert_eq!(verdict(&[part(0.03, 0.03), part(0.2, 0.3), part(0.03, 0.001)]), worst);
        assert_eq!(verdict(&[part(0.2, 0.01), part(0.03, 0.03)]), worst);
    }

    /// Tests that a sensor that is not better is recognised by its errors, whatever the sentence.
    #[test]
    fn a_sensor_that_is_not_better_is_recognised_by_its_errors() {
        let part = |error: f64| Known::new(&scores(error, 0.1), Some(&scores(0.1, 1.0)));
        assert_eq!(is_better(&[part(0.08)]), Some(true));
        for known in [vec![part(0.095)], vec![part(0.2)], vec![part(0.03), part(0.2)]] {
            assert_eq!(is_better(&known), Some(false));
        }
        assert_eq!(is_better(&[Known::new(&scores(0.1, 0.1), None)]), None);
    }

    #[test]
    fn digits_follow_size() {
        assert_eq!((percent(3.24), percent(9.96), percent(40.2)), ("3.2 %".into(), "10 %".into(), "40 %".into()));
    }
}
