use crate::order::{self, extent, sorted};
use crate::samples::{KnownPart, Samples, central_rate, filled_strain, known_parts};

/// Statistics of the strain's motion in the recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotionStats {
    pub strain_mean: f64,
    pub strain_sd: f64,
    pub rate_sd: f64,
    /// Time at which the rate's autocorrelation has fallen to 1/e, s.
    pub rate_time_s: f64,
    /// Mean durations, s, of holds (`None` for a body that does not rest, [`PhaseDurations::rests`]) and of movements in one direction.
    pub hold_s: Option<f64>,
    pub move_s: f64,
    /// Fraction of movements that are followed by another one without a hold.
    pub reversal: f64,
    /// Median speed of movements.
    pub speed: f64,
    /// Lower and upper quartile of the speed in moving rows.
    pub quartile_speeds: (f64, f64),
    /// Longest hold, s; zero for a body that never rests.
    pub longest_hold_s: f64,
    /// 99th percentile of the speed.
    pub fastest_rate: f64,
    pub longest_s: f64,
    /// Number of full strokes in all recordings.
    pub strokes: f64,
    /// Total distances of all stretching and of all releasing movements.
    pub distances: [f64; 2],
}

/// Rows to each side over which a rate is averaged: references are quantised, which dominates the difference of neighbours.
const HALF_WINDOW: usize = 2;

impl MotionStats {
    /// Collects the statistics of the parts between long gaps in the references; of whole recordings, with gaps interpolated, if nothing
    /// moves in these parts.
    pub(crate) fn new(recordings: &[Samples]) -> Self {
        let parts: Vec<Vec<KnownPart>> = recordings.iter().map(known_parts).collect();
        let known = parts.iter().all(|parts| !parts.is_empty()).then(|| Self::of_parts(recordings, &parts));
        let whole = |samples: &Samples| vec![(0..samples.len(), filled_strain(samples))];
        known
            .filter(|stats| stats.strokes > 0.0)
            .unwrap_or_else(|| Self::of_parts(recordings, &recordings.iter().map(whole).collect::<Vec<_>>()))
    }

    fn of_parts(recordings: &[Samples], parts: &[Vec<KnownPart>]) -> Self {
        let (mut strains, mut rates) = (Vec::new(), Vec::new());
        let mut phases = PhaseDurations::default();
        let mut times = Vec::new();
        let mut longest_s = 0.0_f64;
        for (samples, parts) in recordings.iter().zip(parts) {
            let longest = parts.iter().map(|(rows, _)| rows.len()).max();
            for (rows, strain) in parts {
                let time_s = &samples.time_s[rows.clone()];
                let rate = moving_mean(&central_rate(time_s, strain));
                if Some(rows.len()) == longest {
                    times.push(correlation_time(time_s, &rate));
                }
                phases.add(time_s, &rate);
                rates.extend(rate);
                strains.push(strain.clone());
            }
            longest_s = longest_s.max(samples.duration_s());
        }
        let (low, high) = extent(strains.iter().flatten().copied());
        let made = |strain: &Vec<f64>| strokes(strain, high - low).last().copied();
        let strokes = strains.iter().filter_map(made).sum();
        let strains = strains.concat();
        let strain_mean = mean(&strains);
        let deviations: Vec<f64> = strains.iter().map(|x| x - strain_mean).collect();
        let speeds = sorted(rates.iter().map(|v| v.abs()));
        Self {
            strain_mean,
            strain_sd: root_mean_square(&deviations),
            rate_sd: root_mean_square(&rates),
            rate_time_s: mean(&times),
            hold_s: phases.rests().then(|| mean(&phases.holds)),
            move_s: if phases.moves.is_empty() { longest_s } else { mean(&phases.moves) },
            reversal: phases.reversal(),
            speed: phases.speed_at(1, 2),
            quartile_speeds: (phases.speed_at(1, 4), phases.speed_at(3, 4)),
            longest_hold_s: phases.holds.iter().copied().fold(0.0, f64::max),
            fastest_rate: speeds[(speeds.len() - 1) * 99 / 100],
            longest_s,
            strokes,
            distances: phases.distances,
        }
    }
}

/// Smallest movement that counts, as a fraction of a full stroke: references are noisy.
const LEAST_STROKE: f64 = 0.1;

/// Returns the path length from the first row to each, in full strokes of this span; movements below a tenth of a stroke do not count.
pub(crate) fn strokes(strain: &[f64], span: f64) -> Vec<f64> {
    let (mut way, mut place) = (0.0, strain.first().copied().unwrap_or(0.0));
    let to = |x: &f64| {
        let moved = (x - place).abs() / span;
        if moved > LEAST_STROKE {
            (way, place) = (way + moved, *x);
        }
        way
    };
    strain.iter().map(to).collect()
}

/// Fraction of time at rest below which a body only turns around: a sine's rate is below [`REST_SHARE`] of its fast ones for (2/π)
/// asin(0.05 · sin 81°) = 3 % of the time. Three times that.
const LEAST_REST: f64 = 0.1;

/// Durations of holds and movements.
#[derive(Default)]
struct PhaseDurations {
    holds: Vec<f64>,
    moves: Vec<f64>,
    speeds: Vec<f64>,
    /// See [`MotionStats::distances`].
    distances: [f64; 2],
}

/// Fraction of the fast rates (90th percentile) below which a body is at rest.
const REST_SHARE: f64 = 0.05;
/// Minimum number of rows of a phase; shorter ones are flicker.
const FEWEST_PHASE_ROWS: usize = 2;

impl PhaseDurations {
    fn add(&mut self, time_s: &[f64], rate: &[f64]) {
        let directions = directions(rate);
        let mut start = 0;
        for k in 1..=rate.len() {
            if directions.get(k) == Some(&directions[start]) {
                continue;
            }
            if k - start >= FEWEST_PHASE_ROWS {
                let duration = time_s[k.min(rate.len() - 1)] - time_s[start];
                if directions[start] == 0 {
                    self.holds.push(duration);
                } else {
                    self.moves.push(duration);
                    self.distances[usize::from(rate[start] < 0.0)] += duration * mean(&rate[start..k]).abs();
                }
            }
            start = k;
        }
        let moving = rate.iter().zip(&directions).filter(|(_, direction)| **direction != 0);
        self.speeds.extend(moving.map(|(v, _)| v.abs()));
    }

    /// True if the body rests for longer than the moments in which it turns around.
    fn rests(&self) -> bool {
        let (at_rest, moving): (f64, f64) = (self.holds.iter().sum(), self.moves.iter().sum());
        !self.holds.is_empty() && at_rest >= LEAST_REST * (at_rest + moving)
    }

    /// Returns the probability of turning around: each hold ends one movement, and the remaining movements turned around.
    fn reversal(&self) -> f64 {
        (1.0 - self.holds.len() as f64 / self.moves.len().max(1) as f64).clamp(0.05, 0.95)
    }

    /// Returns the quantile `share / of` of the speed in moving rows.
    fn speed_at(&self, share: usize, of: usize) -> f64 {
        let speeds = sorted(self.speeds.iter().copied());
        speeds.get(speeds.len() * share / of).copied().unwrap_or(0.0)
    }
}

/// Returns the direction of each rate: 1, -1, or 0 at rest and where it is unknown (NaN).
pub(crate) fn directions(rate: &[f64]) -> Vec<i8> {
    let speeds = sorted(rate.iter().map(|v| v.abs()).filter(|v| v.is_finite()));
    let rest = REST_SHARE * speeds.get(speeds.len().saturating_sub(1) * 9 / 10).copied().unwrap_or(0.0);
    rate.iter().map(|v| i8::from(*v > rest) - i8::from(*v < -rest)).collect()
}

/// Returns the time at which the autocorrelation crosses 1/e, s, at most half the recording.
fn correlation_time(time_s: &[f64], x: &[f64]) -> f64 {
    let rows = x.len();
    let interval = (time_s[rows - 1] - time_s[0]) / (rows - 1) as f64;
    let power: f64 = x.iter().map(|v| v * v).sum();
    let lag = (1..rows / 2).find(|&lag| {
        let product: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum();
        product < power / std::f64::consts::E
    });
    lag.unwrap_or(rows / 2) as f64 * interval
}

fn mean(x: &[f64]) -> f64 {
    order::mean(x.iter().copied())
}

pub(crate) fn root_mean_square(x: &[f64]) -> f64 {
    order::mean(x.iter().map(|x| x * x)).sqrt()
}

pub(crate) fn moving_mean(x: &[f64]) -> Vec<f64> {
    (0..x.len()).map(|k| mean(&x[k.saturating_sub(HALF_WINDOW)..(k + HALF_WINDOW + 1).min(x.len())])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hold_s(strain: impl Fn(f64) -> f64) -> Option<f64> {
        let time_s: Vec<f64> = (0..3000).map(|k| 0.1 * f64::from(k)).collect();
        let (strain, reading): (Vec<f64>, Vec<f64>) = time_s.iter().map(|t| (strain(*t), 1000.0)).unzip();
        MotionStats::new(&[Samples::new(&time_s, &reading, &strain).unwrap()]).hold_s
    }

    /// Tests a sine: it is slow for 3 % of the time around its turns, which is not a hold.
    #[test]
    fn a_body_that_turns_around_does_not_rest() {
        assert_eq!(hold_s(|t| 0.15 * (1.0 - (std::f64::consts::TAU * t / 30.0).cos())), None);
    }

    /// Tests a strain that rises in 5 s, is held for 10 s, falls in 5 s and is held for 10 s. Averages over five rows round off the corners
    /// by half their width.
    #[test]
    fn holds_between_movements_are_rest() {
        let ramps = |t: f64| 0.3 * ((t % 30.0) / 5.0).min(1.0).min((20.0 - t % 30.0) / 5.0).max(0.0);
        let held = hold_s(ramps).unwrap();
        assert!((held - 10.0).abs() < 0.5, "{held} s");
    }

    /// Tests the same with a reference that fails from one release to another, from 17 to 77 s, and with one that is known at rest only.
    #[test]
    fn a_gap_in_the_reference_is_no_motion_and_no_hold() {
        let ramps = |t: f64| 0.3 * ((t % 30.0) / 5.0).min(1.0).min((20.0 - t % 30.0) / 5.0).max(0.0);
        let held = hold_s(|t| if (17.0..77.0).contains(&t) { f64::NAN } else { ramps(t) }).unwrap();
        assert!((held - 10.0).abs() < 1.0, "{held} s");
        let at_rest = |t: f64| if [0.0, 0.3].contains(&ramps(t)) { ramps(t) } else { f64::NAN };
        assert!((hold_s(at_rest).unwrap() - 10.0).abs() < 1.0);
    }

    /// Tests one extension in 5 s, held for 95 s with a noisy reference, 100 rows a second: a path in steps of a tenth loses a tenth at most.
    #[test]
    fn noise_of_the_reference_makes_no_strokes() {
        let time_s: Vec<f64> = (0..10_000).map(|k| 0.01 * f64::from(k)).collect();
        let noise = |k: usize| 0.004 * ((0.754_877_666 * k as f64).fract() - 0.5);
        let strain: Vec<f64> = time_s.iter().enumerate().map(|(k, t)| 0.06 * t.min(5.0) + noise(k)).collect();
        let reading = vec![1000.0; strain.len()];
        let made = MotionStats::new(&[Samples::new(&time_s, &reading, &strain).unwrap()]).strokes;
        assert!((0.9..=1.0).contains(&made), "{made}");
    }
}
