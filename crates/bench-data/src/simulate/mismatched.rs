use ohmstrain_model::Phase;

use super::Material;
use super::bench::{Movement, Sensor};

const BRANCHES: usize = 9;
const PLAYS: usize = 3;

/// Time constants, s, from the fastest to the slowest, log-spaced.
const FASTEST_S: f64 = 0.4;
const SLOWEST_S: f64 = 2500.0;
/// Weights of the branches fall as τ^-0.22: together they relax much like a stretched exponential.
const SPECTRUM: f64 = -0.22;
/// Branches are driven by |v|^0.9, in units of this rate, 1/s: gains depend on speed.
const DRIVE_POWER: f64 = 0.9;
const DRIVE_RATE: f64 = 0.1;
/// Broken paths cannot break again: the drive fades as the relaxing share nears this ceiling, so that cycling settles
/// into a band instead of climbing for ever.
const CEILING: f64 = 2.0;
/// Half-widths of the play operators, and their common weight.
const PLAY_STRAINS: [f64; PLAYS] = [0.01, 0.03, 0.08];
const PLAY_WEIGHT: f64 = 0.1;
/// Resistance that the largest strain so far leaves behind for good, and how slowly it comes, s.
const MEMORY_PER_STRAIN: f64 = 0.06;
const MEMORY_TIME_S: f64 = 150.0;

/// A sensor outside of the family that is fitted: nine branches with gains that are not affine in strain and a drive
/// that is not linear in speed and saturates, hysteresis without a time constant (play operators), and a memory of the largest strain.
pub(super) struct Mismatched {
    gauge_slope: f64,
    gauge_peak: f64,
    tau_s: [f64; BRANCHES],
    weight: [f64; BRANCHES],
    relaxation: [f64; BRANCHES],
    play: [f64; PLAYS],
    largest_strain: f64,
    memory: f64,
}

impl Mismatched {
    pub(super) fn new(material: Material) -> Self {
        let (gauge_slope, gauge_peak, time_scale) = match material {
            Material::Ecoflex0030 => (3.3, 0.20, 1.0),
            Material::Ecoflex0050 => (4.6, 0.12, 0.35),
            Material::Vytaflex10 => (3.1, 0.20, 1.2),
        };
        let spacing = (SLOWEST_S / FASTEST_S).powf(1.0 / (BRANCHES - 1) as f64);
        let tau_s = std::array::from_fn(|i| time_scale * FASTEST_S * spacing.powi(i as i32));
        let spectrum: [f64; BRANCHES] = tau_s.map(|tau: f64| tau.powf(SPECTRUM));
        let total: f64 = spectrum.iter().sum();
        Self {
            gauge_slope,
            gauge_peak,
            tau_s,
            weight: spectrum.map(|share| share / total),
            relaxation: [0.0; BRANCHES],
            play: [0.0; PLAYS],
            largest_strain: 0.0,
            memory: 0.0,
        }
    }
}

impl Mismatched {
    /// Drive of the branches, 1/s, with the branches where they are.
    fn drive(&self, movement: &Movement, relaxation: &[f64; BRANCHES]) -> f64 {
        let left_to_break = (1.0 - relaxation.iter().sum::<f64>() / CEILING).max(0.0);
        let gain = left_to_break * gain(movement.mid_strain(), movement.phase());
        gain * (movement.rate.abs() / DRIVE_RATE).powf(DRIVE_POWER) * DRIVE_RATE
    }

    /// The branches after a share of the movement under a constant drive.
    fn relaxed(&self, movement: &Movement, share: f64, drive: f64) -> [f64; BRANCHES] {
        std::array::from_fn(|i| {
            let gone = -(-share * movement.duration_s / self.tau_s[i]).exp_m1();
            self.relaxation[i] + gone * (self.weight[i] * drive * self.tau_s[i] - self.relaxation[i])
        })
    }
}

impl Sensor for Mismatched {
    fn advance(&mut self, movement: &Movement) {
        // The drive fades with what it has driven: evaluate it in the middle of the step, which is of second order.
        let half = self.relaxed(movement, 0.5, self.drive(movement, &self.relaxation));
        self.relaxation = self.relaxed(movement, 1.0, self.drive(movement, &half));
        for (play, half_width) in self.play.iter_mut().zip(PLAY_STRAINS) {
            *play = play.clamp(movement.to_strain - half_width, movement.to_strain + half_width);
        }
        self.largest_strain = self.largest_strain.max(movement.to_strain);
        let gone = -(-movement.duration_s / MEMORY_TIME_S).exp_m1();
        self.memory += gone * (MEMORY_PER_STRAIN * self.largest_strain - self.memory);
    }

    fn relative_change(&self, movement: &Movement) -> f64 {
        let strain = movement.to_strain;
        let gauge = self.gauge_slope * strain * (-strain / self.gauge_peak).exp();
        let relaxing: f64 = self.relaxation.iter().sum();
        gauge + relaxing + PLAY_WEIGHT * self.play.iter().sum::<f64>() + self.memory
    }
}

/// How strongly movement breaks conducting paths, per unit of strain: releasing from a large strain breaks most, which
/// makes the peak on the way back.
fn gain(strain: f64, phase: Phase) -> f64 {
    match phase {
        Phase::Extend => 1.7 * (-strain / 0.25).exp() + 0.3,
        Phase::Hold => 0.0,
        Phase::Retract => 2.8 * -(-(strain / 0.13).powi(2)).exp_m1(),
    }
}
