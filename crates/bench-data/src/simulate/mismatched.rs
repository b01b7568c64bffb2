use ohmstrain_model::Phase;

use super::Material;
use super::individual::{CHARACTER_SPREAD, Individual};
use super::sensor::{Movement, StretchedSensor};

const BRANCHES: usize = 9;
const PLAYS: usize = 3;

/// Fastest of the log-spaced time constants, s.
const FASTEST_S: f64 = 0.4;
/// Power of the rate that drives the branches, |v|^0.9, so that gains depend on speed, and unit of that rate, 1/s.
const DRIVE_POWER: f64 = 0.9;
const DRIVE_RATE: f64 = 0.1;
/// Ceiling of the relaxing resistance: broken paths cannot break again, so the drive fades near it, and cycling settles into a band instead
/// of climbing for ever.
const CEILING: f64 = 2.0;
/// Half-widths of the play operators.
const PLAY_STRAINS: [f64; PLAYS] = [0.01, 0.03, 0.08];
/// Time constant with which the largest strain so far leaves a resistance behind, s.
const MEMORY_TIME_S: f64 = 150.0;

/// Character of a mismatched sensor.
#[derive(Clone, Copy)]
struct Character {
    /// Slope and peak of the quasi-static curve.
    gauge_slope: f64,
    gauge_peak: f64,
    /// Factor on all time constants, and the slowest of them before that, s.
    time_scale: f64,
    slowest_s: f64,
    /// Power of τ to which the weights of the branches are proportional: with -0.22 their sum relaxes much like a stretched exponential.
    spectrum: f64,
    /// Factor on the rate at which conducting paths break.
    breaking: f64,
    /// Common weight of the play operators.
    play_weight: f64,
    /// Permanent resistance per unit of the largest strain so far.
    memory_per_strain: f64,
}

/// Modelled on 10 wt-% carbon black.
const STRONG: Character = Character {
    gauge_slope: 3.3,
    gauge_peak: 0.20,
    time_scale: 1.0,
    slowest_s: 2500.0,
    spectrum: -0.22,
    breaking: 1.0,
    play_weight: 0.1,
    memory_per_strain: 0.06,
};

impl Character {
    const fn of(material: Material) -> Self {
        match material {
            Material::Ecoflex0030 => STRONG,
            Material::Ecoflex0050 => Self { gauge_slope: 4.6, gauge_peak: 0.12, time_scale: 0.35, ..STRONG },
            Material::Vytaflex10 => Self { gauge_slope: 3.1, time_scale: 1.2, ..STRONG },
            Material::Representative => Self {
                gauge_slope: 2.6,
                gauge_peak: 1.0,
                slowest_s: 600.0,
                spectrum: -1.2,
                breaking: 3.5,
                play_weight: 0.6,
                memory_per_strain: 0.03,
                ..STRONG
            },
        }
    }

    /// Draws one sensor of this make.
    fn drawn(self, individual: &mut Individual) -> Self {
        let mut drawn = |of_make: f64| of_make * individual.factor(CHARACTER_SPREAD);
        Self {
            gauge_slope: drawn(self.gauge_slope),
            gauge_peak: drawn(self.gauge_peak),
            time_scale: drawn(self.time_scale),
            breaking: drawn(self.breaking),
            play_weight: drawn(self.play_weight),
            memory_per_strain: drawn(self.memory_per_strain),
            ..self
        }
    }
}

/// A sensor outside the fitted family: nine branches with gains that are not affine in strain, and a drive that is not linear in speed and
/// saturates; hysteresis without a time constant (play operators); and a memory of the largest strain.
pub(super) struct Mismatched {
    character: Character,
    tau_s: [f64; BRANCHES],
    weight: [f64; BRANCHES],
    relaxation: [f64; BRANCHES],
    play: [f64; PLAYS],
    largest_strain: f64,
    memory: f64,
}

impl Mismatched {
    pub(super) fn new(material: Material, individual: &mut Individual) -> Self {
        let character = Character::of(material).drawn(individual);
        let spacing = (character.slowest_s / FASTEST_S).powf(1.0 / (BRANCHES - 1) as f64);
        let tau_s = std::array::from_fn(|i| character.time_scale * FASTEST_S * spacing.powi(i as i32));
        let spectrum: [f64; BRANCHES] = tau_s.map(|tau: f64| tau.powf(character.spectrum));
        let total: f64 = spectrum.iter().sum();
        Self {
            character,
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
    /// Returns the drive of the branches, 1/s, at their present state.
    fn drive(&self, movement: &Movement, relaxation: &[f64; BRANCHES]) -> f64 {
        let left_to_break = (1.0 - relaxation.iter().sum::<f64>() / CEILING).max(0.0);
        let gain = self.character.breaking * left_to_break * gain(movement.mid_strain(), movement.phase());
        gain * (movement.rate.abs() / DRIVE_RATE).powf(DRIVE_POWER) * DRIVE_RATE
    }

    /// Returns the branches after a fraction of the movement under a constant drive.
    fn relaxed(&self, movement: &Movement, share: f64, drive: f64) -> [f64; BRANCHES] {
        std::array::from_fn(|i| {
            let gone = -(-share * movement.duration_s / self.tau_s[i]).exp_m1();
            self.relaxation[i] + gone * (self.weight[i] * drive * self.tau_s[i] - self.relaxation[i])
        })
    }
}

impl StretchedSensor for Mismatched {
    fn advance(&mut self, movement: &Movement) {
        // The drive fades with the state: it is evaluated in the middle of the step, with an error of second order.
        let half = self.relaxed(movement, 0.5, self.drive(movement, &self.relaxation));
        self.relaxation = self.relaxed(movement, 1.0, self.drive(movement, &half));
        for (play, half_width) in self.play.iter_mut().zip(PLAY_STRAINS) {
            *play = play.clamp(movement.to_strain - half_width, movement.to_strain + half_width);
        }
        self.largest_strain = self.largest_strain.max(movement.to_strain);
        let gone = -(-movement.duration_s / MEMORY_TIME_S).exp_m1();
        self.memory += gone * (self.character.memory_per_strain * self.largest_strain - self.memory);
    }

    fn relative_change(&self, movement: &Movement) -> f64 {
        let strain = movement.to_strain;
        let gauge = self.character.gauge_slope * strain * (-strain / self.character.gauge_peak).exp();
        let relaxing: f64 = self.relaxation.iter().sum();
        gauge + relaxing + self.character.play_weight * self.play.iter().sum::<f64>() + self.memory
    }
}

/// Returns the rate at which movement breaks conducting paths, per unit of strain: releasing from a large strain breaks most, which causes
/// the peak on release.
fn gain(strain: f64, phase: Phase) -> f64 {
    match phase {
        Phase::Extend => 1.7 * (-strain / 0.25).exp() + 0.3,
        Phase::Hold => 0.0,
        Phase::Retract => 2.8 * -(-(strain / 0.13).powi(2)).exp_m1(),
    }
}
