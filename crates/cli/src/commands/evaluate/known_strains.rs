use ohmstrain::{KNOWN_BEYOND, Known};
use ohmstrain_model::StrainRange;
use ohmstrain_report::Scored;

use ohmstrain::trace::TraceFile;

/// Largest distance of a strain from an end of the reference's range at which it counts as being at that end, as a share of the
/// range.
const NEAR_END: f64 = 0.1;

/// Known strains that an estimator receives from the reference before it is scored with it.
pub struct KnownStrains {
    /// Name in tables; `None` if there are no known strains.
    pub name: Option<String>,
    /// The strains.
    pub known: Vec<Known>,
}

impl KnownStrains {
    /// Returns the cases: no known strain; and, if an interval in s is given, one known strain after each such interval, and
    /// the first strains near the ends of the range. All of them lie in the scored part, and within the estimator's limits.
    pub fn cases(recording: &TraceFile, part: Scored, limits: StrainRange<f64>, every_s: Option<f64>) -> Vec<Self> {
        let mut cases = vec![Self { name: None, known: Vec::new() }];
        if let Some(every_s) = every_s {
            let reach = KNOWN_BEYOND * limits.span();
            let is_usable = |known: &Known| (limits.lower - reach..=limits.upper + reach).contains(&known.strain);
            let rows =
                (0..recording.trace.len()).map(|row| Known::new(recording.trace.time_s[row], recording.truth(row)));
            let rows: Vec<Known> = rows.filter(|known| part.holds(known.time_s) && is_usable(known)).collect();
            cases.push(Self { name: Some(format!("known every {every_s} s")), known: every(&rows, every_s) });
            cases.push(Self { name: Some("rest and stretch known".into()), known: ends(&rows) });
        }
        cases
    }
}

fn every(rows: &[Known], every_s: f64) -> Vec<Known> {
    let mut due_s = f64::NEG_INFINITY;
    let is_due = |known: &&Known| {
        let is_due = known.time_s >= due_s;
        if is_due {
            due_s = known.time_s + every_s;
        }
        is_due
    };
    rows.iter().filter(is_due).copied().collect()
}

fn ends(rows: &[Known]) -> Vec<Known> {
    let least = rows.iter().map(|known| known.strain).fold(f64::INFINITY, f64::min);
    let most = rows.iter().map(|known| known.strain).fold(f64::NEG_INFINITY, f64::max);
    let near = NEAR_END * (most - least);
    let low = rows.iter().find(|known| known.strain <= least + near);
    let high = rows.iter().find(|known| known.strain >= most - near);
    low.into_iter().chain(high).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_strains_are_periodic_or_near_the_ends() {
        let rows: Vec<Known> = (0..100).map(|k| Known::new(f64::from(k), f64::from((k * 7) % 100))).collect();
        let times: Vec<f64> = every(&rows, 30.0).iter().map(|known| known.time_s).collect();
        assert_eq!(times, [0.0, 30.0, 60.0, 90.0]);
        let strains: Vec<f64> = ends(&rows).iter().map(|known| known.strain).collect();
        assert_eq!(strains, [0.0, 91.0]);
        assert!(ends(&[]).is_empty() && every(&[], 1.0).is_empty());
    }
}
