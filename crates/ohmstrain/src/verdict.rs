//! Scores in words.

use ohmstrain_calib::Scores;

use crate::number::fixed;

/// Below this share of the static cubic's error an estimate is clearly better, below this one better.
const CLEARLY_BETTER: f64 = 0.5;
const BETTER: f64 = 0.9;
/// Coverages of 95 % intervals, in percent, that are taken for right.
const COVERED: f64 = 90.0;
/// Mean width of 95 % intervals, in percent of full scale, that says little: the standard deviation of a constant guess in
/// the middle of an evenly used range gives 113.
const WIDE: f64 = 60.0;

/// What an error and its intervals are worth, in one sentence.
pub fn verdict(scores: &Scores, static_cubic: Option<&Scores>) -> String {
    let better = match static_cubic.map(|cubic| scores.rmse / cubic.rmse) {
        Some(ratio) if ratio < CLEARLY_BETTER => "Clearly better than a static curve",
        Some(ratio) if ratio < BETTER => "Better than a static curve",
        Some(ratio) if ratio < 1.0 / BETTER => "About as good as a static curve",
        Some(_) => "Worse than a static curve",
        None => "No static curve to compare with",
    };
    format!("{better}; {}.", of_intervals(scores))
}

fn of_intervals(scores: &Scores) -> &'static str {
    let covered = scores.coverage_95.map_or(0.0, |share| 100.0 * share);
    let wide = scores.width_95_percent_fs.is_some_and(|width| width > WIDE);
    match (covered < COVERED, wide) {
        (true, _) => "its error bars are too narrow",
        (false, true) => "its error bars hold, but are wide",
        (false, false) => "its error bars hold",
    }
}

/// A number in percent as people read it: two digits below ten, whole ones above.
pub fn percent(value: f64) -> String {
    fixed(value, i32::from(value.abs() < 9.95)) + " %"
}

#[cfg(test)]
mod tests {
    use ohmstrain_calib::{ScoredRow, Scores};

    use super::{percent, verdict};

    fn scores(error: f64, sd: f64) -> Scores {
        let row = |k: u32| {
            let truth = f64::from(k % 11) / 10.0;
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            ScoredRow { time_s: f64::from(k), truth, strain: truth + sign * error, sd: Some(sd) }
        };
        Scores::new(&(0..110).map(row).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn error_and_intervals_are_judged() {
        let cubic = scores(0.1, 1.0);
        assert_eq!(
            verdict(&scores(0.03, 0.03), Some(&cubic)),
            "Clearly better than a static curve; its error bars hold."
        );
        assert_eq!(
            verdict(&scores(0.08, 0.01), Some(&cubic)),
            "Better than a static curve; its error bars are too narrow."
        );
        let wide = "Worse than a static curve; its error bars hold, but are wide.";
        assert_eq!(verdict(&scores(0.2, 0.3), Some(&cubic)), wide);
        assert!(verdict(&scores(0.1, 0.1), None).starts_with("No static curve"));
    }

    #[test]
    fn digits_follow_size() {
        assert_eq!((percent(3.24), percent(9.96), percent(40.2)), ("3.2 %".into(), "10 %".into(), "40 %".into()));
    }
}
