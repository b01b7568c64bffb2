//! Candidate recordings: strain over time.

use ohmstrain::SensorParams;
use ohmstrain::number::significant;

/// Readings per second of these recordings.
pub const RATE_HZ: f64 = 20.0;
/// Speeds as fractions of the fastest.
const SPEEDS: [f64; 3] = [1.0, 0.4, 0.15];
/// Duration of a hold in multiples of the slowest relaxation, and its bounds, s.
const HOLD: f64 = 3.0;
const HOLD_S: (f64, f64) = (10.0, 300.0);
/// Duration of a hold that does not wait for slow relaxation, s.
const SHORT_HOLD_S: f64 = 5.0;
/// Levels of holds, as fractions of the range.
const LEVELS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// Number of movements to and fro at each speed.
const CYCLES: usize = 6;

/// A candidate recording.
pub struct Protocol {
    pub name: String,
    pub strain: Vec<f64>,
}

/// Common properties of the protocols.
pub struct Protocols {
    low: f64,
    high: f64,
    /// Speeds, per second, fastest first.
    pub speeds: Vec<f64>,
    /// Slowest relaxation time, s.
    pub slowest_s: f64,
}

impl Protocols {
    /// Prepares protocols for a sensor's range, speeds and time constants.
    pub fn new(params: &SensorParams) -> Self {
        let range = params.law.range;
        let slowest_s = params.law.branches.iter().map(|branch| branch.tau_s).fold(1.0, f64::max);
        // Covering the whole range in a tenth of a second is faster than any test stage.
        let fastest = params.validity.fastest_rate_per_s.min(10.0 * range.span());
        let speeds = SPEEDS.map(|share| share * fastest).to_vec();
        Self { low: range.lower, high: range.upper, speeds, slowest_s }
    }

    /// Returns the recordings, the least informative first.
    pub fn all(&self) -> Vec<Protocol> {
        let hold_s = (HOLD * self.slowest_s).clamp(HOLD_S.0, HOLD_S.1);
        let one = Protocol { name: "to and fro, one speed".into(), strain: self.cycles(&self.speeds[..1], 3 * CYCLES) };
        let several = Protocol { name: "to and fro, three speeds".into(), strain: self.cycles(&self.speeds, CYCLES) };
        let held = |seconds: f64| Protocol {
            name: format!("three speeds, holds of {} s at four levels", significant(seconds, 2)),
            strain: self.with_holds(CYCLES, seconds),
        };
        vec![one, several, held(SHORT_HOLD_S), held(hold_s)]
    }

    /// Returns the motion by which sampling is judged: all speeds, and short holds.
    pub fn usual(&self) -> Vec<f64> {
        self.with_holds(CYCLES / 2, SHORT_HOLD_S)
    }

    fn cycles(&self, speeds: &[f64], count: usize) -> Vec<f64> {
        let mut path = Path::at(self.low);
        path.hold(5.0);
        for speed in speeds {
            for cycle in 0..count {
                // Every second movement goes half-way only, so that the same strain has different histories.
                let top = if cycle % 2 == 0 { self.high } else { self.low + 0.5 * (self.high - self.low) };
                path.go(top, *speed);
                path.go(self.low, *speed);
            }
        }
        path.strain
    }

    fn with_holds(&self, cycles: usize, hold_s: f64) -> Vec<f64> {
        let mut path = Path { strain: self.cycles(&self.speeds, cycles) };
        for (place, level) in LEVELS.into_iter().enumerate() {
            path.go(self.low + level * (self.high - self.low), self.speeds[place % self.speeds.len()]);
            path.hold(hold_s);
            path.go(self.low, self.speeds[(place + 1) % self.speeds.len()]);
            path.hold(hold_s);
        }
        path.strain
    }
}

struct Path {
    strain: Vec<f64>,
}

impl Path {
    fn at(strain: f64) -> Self {
        Self { strain: vec![strain] }
    }

    fn last(&self) -> f64 {
        self.strain.last().copied().unwrap_or(0.0)
    }

    fn hold(&mut self, seconds: f64) {
        let last = self.last();
        self.strain.extend(std::iter::repeat_n(last, (seconds * RATE_HZ) as usize));
    }

    fn go(&mut self, to: f64, speed: f64) {
        let from = self.last();
        let steps = ((to - from).abs() / speed * RATE_HZ).ceil().max(1.0);
        self.strain.extend((1..=steps as usize).map(|step| from + (to - from) * step as f64 / steps));
    }
}

/// Interpolates the strain linearly at another rate.
pub fn at_rate(strain: &[f64], rate_hz: f64) -> Vec<f64> {
    let end_s = (strain.len() - 1) as f64 / RATE_HZ;
    let at = |row: usize| {
        let place = (row as f64 / rate_hz * RATE_HZ).min((strain.len() - 1) as f64);
        let (before, share) = (place.floor() as usize, place.fract());
        let after = (before + 1).min(strain.len() - 1);
        strain[before] + share * (strain[after] - strain[before])
    };
    (0..=(end_s * rate_hz) as usize).map(at).collect()
}
