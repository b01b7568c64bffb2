//! A person who follows a protocol imperfectly.

use std::fmt;
use std::str::FromStr;

use rand_chacha::ChaCha8Rng;

use super::noise::normal;
use super::profile::{Profile, unit};
use super::settings::{SettingsError, within};
use crate::error::SpecError;
use crate::pacing::Pacing;
use crate::row::ReferenceQuantity;
use crate::spec::Pairs;

/// Shortest and longest reaction time to a cue, s.
const REACTION_S: (f64, f64) = (0.15, 0.6);
/// Shortest and longest move, as multiples of the protocol's.
const PACE: (f64, f64) = (0.8, 1.25);
/// Standard deviation of the overshoot of a move, as a fraction of its distance, and the time to correct it, s.
const OVERSHOOT: f64 = 0.04;
const MENDED_S: f64 = 0.4;
/// Largest advance or delay within a move, as a fraction of its duration.
const UNEVEN: f64 = 0.12;
/// Number of knots of a move.
const KNOTS: usize = 24;
/// Fraction by which a hold is cut short, if it is.
const CUT: (f64, f64) = (0.2, 0.5);

/// Faults of a person who follows a protocol: `mark_sd=0.02 missed=0 cut_short=0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Standard deviation of a position from the protocol's, as a fraction of the span of all positions; half of its variance is the same
    /// at every visit of the position.
    pub mark_sd: f64,
    /// Fraction of the steps that are missed.
    pub missed: f64,
    /// Fraction of the holds that end early.
    pub cut_short: f64,
}

impl Default for Person {
    fn default() -> Self {
        Self { mark_sd: 0.02, missed: 0.0, cut_short: 0.0 }
    }
}

impl FromStr for Person {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let pairs = Pairs::parse(text, &["mark_sd", "missed", "cut_short"])?;
        let usual = Self::default();
        let person = Self {
            mark_sd: pairs.number_or("mark_sd", usual.mark_sd)?,
            missed: pairs.number_or("missed", usual.missed)?,
            cut_short: pairs.number_or("cut_short", usual.cut_short)?,
        };
        person.validate().map_err(|error| SpecError::new("shares of 0 to 1", error.to_string()))?;
        Ok(person)
    }
}

impl fmt::Display for Person {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "mark_sd={} missed={} cut_short={}", self.mark_sd, self.missed, self.cut_short)
    }
}

impl Person {
    fn validate(&self) -> Result<(), SettingsError> {
        within("mark_sd", self.mark_sd, 0.0, 1.0)?;
        within("missed", self.missed, 0.0, 1.0)?;
        within("cut_short", self.cut_short, 0.0, 1.0)
    }
}

/// A protocol that a simulated person follows with one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// The protocol.
    pub pacing: Pacing,
    /// Index of the joint in the protocol; 0 if the protocol has one value for all.
    pub joint: usize,
    /// The person.
    pub person: Person,
}

impl Followed {
    /// Refuses strains that the simulated sensor cannot reach.
    pub(super) fn validate(&self) -> Result<(), SettingsError> {
        self.person.validate()?;
        within("steps of the protocol", self.pacing.steps.len() as f64, 1.0, 1e4)?;
        let values = self.pacing.positions.iter().map(|position| self.value(position.values.as_slice()));
        let (longest, setting) = match self.pacing.quantity {
            ReferenceQuantity::Strain => (0.5, "strain of a position"),
            ReferenceQuantity::AngleDeg => (180.0, "angle of a position"),
        };
        values.into_iter().try_for_each(|value| within(setting, value, 0.0, longest))
    }

    fn value(&self, values: &[f64]) -> f64 {
        values.get(self.joint).copied().unwrap_or(f64::NAN)
    }

    /// Returns the strain per unit of the protocol: 1, or for angles the value at which the largest one stretches the sensor by
    /// `full_strain`.
    pub(super) fn strain_per_unit(&self, full_strain: f64) -> f64 {
        let values = self.pacing.positions.iter().map(|position| self.value(&position.values));
        match self.pacing.quantity {
            ReferenceQuantity::Strain => 1.0,
            ReferenceQuantity::AngleDeg => full_strain / values.fold(f64::MIN_POSITIVE, f64::max),
        }
    }

    /// Returns the person's strain over time.
    pub(super) fn profile(&self, full_strain: f64, random: &mut ChaCha8Rng) -> Profile {
        let factor = self.strain_per_unit(full_strain);
        let nominal: Vec<f64> =
            self.pacing.positions.iter().map(|position| factor * self.value(&position.values)).collect();
        let span = nominal.iter().copied().fold(0.0, f64::max) - nominal.iter().copied().fold(f64::INFINITY, f64::min);
        let spread = self.person.mark_sd * span * 0.5_f64.sqrt();
        // A sensor cannot be compressed.
        let off = |value: f64, random: &mut ChaCha8Rng| (value + spread * normal(random)).max(0.0);
        let own: Vec<f64> = nominal.iter().map(|value| off(*value, random)).collect();
        let (mut begun_s, mut place) = (0.0, 0.0);
        let mut profile = Profile::at(0.0);
        for (k, step) in self.pacing.steps.iter().enumerate() {
            let end_s = begun_s + step.duration_s();
            let between = |(low, high): (f64, f64), random: &mut ChaCha8Rng| low + (high - low) * unit(random);
            let (reaction_s, pace) = (between(REACTION_S, random), between(PACE, random));
            let (uneven, overshoot) = (UNEVEN * (2.0 * unit(random) - 1.0), OVERSHOOT * normal(random).abs());
            let is_missed = unit(random) < self.person.missed;
            let is_cut = unit(random) < self.person.cut_short;
            let cut = if is_cut { between(CUT, random) } else { 0.0 };
            let goal = off(own[step.to], random);
            if k == 0 {
                profile.line_to(MENDED_S, goal);
                place = goal;
            } else if !is_missed && step.move_s > 0.0 {
                let (from, duration_s) = (place, pace * step.move_s);
                // If the previous hold was cut short, it has ended before this step's cue.
                profile.until(begun_s + reaction_s);
                let reached = (goal + overshoot * (goal - from)).max(0.0);
                let start_s = profile.duration_s();
                for knot in 1..=KNOTS {
                    let u = knot as f64 / KNOTS as f64;
                    let warped = u + uneven * (std::f64::consts::PI * u).sin();
                    profile.line_to(start_s + u * duration_s, from + (reached - from) * minimum_jerk(warped));
                }
                profile.line_to(start_s + duration_s + MENDED_S, goal);
                place = goal;
            }
            if cut > 0.0 && k > 0 {
                // Halfway back to the previous position, for the rest of the hold.
                profile.until(end_s - cut * step.hold_s);
                let before = own[self.pacing.steps[k - 1].to];
                place = 0.5 * (place + before);
                profile.line_to(profile.duration_s() + MENDED_S, place);
            }
            profile.until(end_s);
            begun_s = end_s;
        }
        profile
    }
}

/// Returns the progress of a move, 0 to 1, at the fraction `u` of its time. Source: Flash and Hogan, *J. Neurosci.* 5 (1985) 1688.
fn minimum_jerk(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u.powi(3) * (10.0 + u * (6.0 * u - 15.0))
}
