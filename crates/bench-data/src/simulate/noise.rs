use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::settings::{SettingsError, within};

/// Disturbances of the reading beyond the sensor's own behaviour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbances {
    /// Standard deviation of the white noise, as a fraction of R₀; usually 2e-4.
    pub white_sd: f64,
    /// Power spectral density of the 1/f drift of R at 1 Hz, 1/Hz, relative to R; usually 1e-8.
    pub drift_density: f64,
    /// True if the first cycles permanently lower the resistance, by 1.9, 1.5, 1.0 and 0.3 %.
    pub conditioning: bool,
}

impl Disturbances {
    /// Disturbances measured on a bench.
    pub const BENCH: Self = Self { white_sd: 2e-4, drift_density: 1e-8, conditioning: true };
    /// No disturbances.
    pub const NONE: Self = Self { white_sd: 0.0, drift_density: 0.0, conditioning: false };

    pub(super) fn validate(&self) -> Result<(), SettingsError> {
        within("white_sd", self.white_sd, 0.0, 1.0)?;
        within("drift_density", self.drift_density, 0.0, 1.0)
    }
}

/// Number of processes per decade of frequency: two keep the sum within 3 % of 1/f.
const PER_DECADE: i32 = 2;
/// Range of time constants, s, as powers of ten: 0.01 s to 10 000 s.
const DECADES: std::ops::RangeInclusive<i32> = -2..=4;

/// Drift with a 1/f spectrum: a sum of Ornstein-Uhlenbeck processes with log-spaced time constants.
///
/// Each has the power of 1/f in its part of a decade, so no long record has to be filtered at once.
pub(super) struct Drift {
    processes: Vec<Process>,
}

struct Process {
    tau_s: f64,
    sd: f64,
    state: f64,
}

impl Drift {
    pub(super) fn new(density: f64, random: &mut ChaCha8Rng) -> Self {
        let sd = (density * std::f64::consts::LN_10 / f64::from(PER_DECADE)).sqrt();
        let processes = (DECADES.start() * PER_DECADE..=DECADES.end() * PER_DECADE)
            .map(|i| {
                let tau_s = 10_f64.powf(f64::from(i) / f64::from(PER_DECADE));
                Process { tau_s, sd, state: sd * normal(random) }
            })
            .collect();
        Self { processes }
    }

    /// Advances by `step_s`, s, and returns the drift.
    pub(super) fn advance(&mut self, step_s: f64, random: &mut ChaCha8Rng) -> f64 {
        for process in &mut self.processes {
            let kept = (-step_s / process.tau_s).exp();
            let fresh = process.sd * (-(-2.0 * step_s / process.tau_s).exp_m1()).sqrt();
            process.state = kept * process.state + fresh * normal(random);
        }
        self.processes.iter().map(|process| process.state).sum()
    }
}

/// Independent random numbers for each purpose, so that switching one off leaves the others unchanged.
#[derive(Clone, Copy)]
pub(super) enum Stream {
    Profile = 1,
    White,
    Drift,
    Converter,
    Individual,
}

pub(super) fn random(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream as u64);
    random
}

pub(crate) fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Permanent change after each cycle, relative to R.
const CONDITIONED: [f64; 5] = [0.0, -0.019, -0.034, -0.044, -0.047];

/// Returns the change after a number of full cycles, interpolated linearly.
pub(super) fn conditioning(cycles: f64) -> f64 {
    let last = CONDITIONED.len() - 1;
    let done = (cycles.floor() as usize).min(last);
    let next = (done + 1).min(last);
    CONDITIONED[done] + (cycles - cycles.floor()) * (CONDITIONED[next] - CONDITIONED[done])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditioning_follows_the_cycles() {
        assert_eq!(conditioning(0.0), 0.0);
        assert!((conditioning(0.5) + 0.0095).abs() < 1e-12);
        assert!((conditioning(3.0) + 0.044).abs() < 1e-12);
        assert_eq!(conditioning(100.0), -0.047);
    }

    /// For 1/f noise, the variance of differences of averages over a second is `2 ln 2 · density` (Allan variance
    /// `2 ln 2 · h` is half the mean square difference), at any averaging time.
    #[test]
    fn drift_has_the_density_asked_for() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut drift = Drift::new(1e-8, &mut random);
        let (averages, per_average) = (4000, 50);
        let means: Vec<f64> = (0..averages)
            .map(|_| (0..per_average).map(|_| drift.advance(0.02, &mut random)).sum::<f64>() / f64::from(per_average))
            .collect();
        let allan = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>() / (2.0 * means.len() as f64);
        // 4000 squares of correlated differences scatter by some 3 %; two processes per decade add a ripple of 3 %.
        let ratio = allan / (2.0 * std::f64::consts::LN_2 * 1e-8);
        assert!((ratio - 1.0).abs() < 0.12, "{ratio}");
    }
}
