//! Protocols that pace a person: rest, move to a mark in two seconds, hold for ten, move back.

use thiserror::Error;

use crate::row::ReferenceQuantity;

/// Largest number of steps in a protocol.
pub const MOST_STEPS: usize = 10_000;
/// Longest step, s.
const LONGEST_S: f64 = 1e5;
/// Time after which the body is assumed to have settled, s, and its largest value as a fraction of the hold.
const SETTLING_S: f64 = 1.0;
const SETTLING_SHARE: f64 = 1.0 / 3.0;
/// Largest time by which a person who sees a countdown leaves early, s.
const EARLY_S: f64 = 0.3;
const EARLY_SHARE: f64 = 0.1;

/// Reaction time of a person to a cue, s.
const REACTION_S: f64 = 0.4;
/// Standard deviation of the start and the end of a paced hold, s, due to the reaction time of a person and to moves that take longer or
/// shorter than planned.
pub const PERSON_SD_S: f64 = 0.35;
/// Largest extension of a hold, as a fraction of the time to the neighbouring hold.
const LONGEST_SHARE: f64 = 0.4;

/// Returns the probable start and end of a hold, s, given its certain part by [`PacedStep::held_s`]: the times at which the person has
/// probably arrived and left. `between` are the end of the previous hold's certain part and the start of the next one's, s.
#[must_use]
pub fn probable_hold((from_s, until_s): (f64, f64), (before_s, after_s): (Option<f64>, Option<f64>)) -> (f64, f64) {
    let earlier_s = before_s.map_or(0.0, |before_s| (SETTLING_S - REACTION_S).min(LONGEST_SHARE * (from_s - before_s)));
    let later_s = after_s.map_or(0.0, |after_s| (EARLY_S + REACTION_S).min(LONGEST_SHARE * (after_s - until_s)));
    (from_s - earlier_s, until_s + later_s)
}

/// A protocol for a person: known positions, and the order in which they are visited.
#[derive(Clone, Debug, PartialEq)]
pub struct Pacing {
    /// Quantity of the positions' values.
    pub quantity: ReferenceQuantity,
    /// Names of joints with their own values; empty if one value applies to all channels.
    pub joints: Vec<String>,
    /// The positions.
    pub positions: Vec<Position>,
    /// The steps; none if a person marks by hand.
    pub steps: Vec<PacedStep>,
}

/// A position in which the strain is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Position {
    /// Its name.
    pub name: String,
    /// Strain or angle of each joint, or the only one.
    pub values: Vec<f64>,
    /// Standard deviation with which a person keeps it.
    pub sd: f64,
}

/// A move to a position and a hold there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PacedStep {
    /// Index of the position.
    pub to: usize,
    /// Duration of the move, s; zero if the body is already there.
    pub move_s: f64,
    /// Duration of the hold, s.
    pub hold_s: f64,
}

/// Reason why a protocol is invalid.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PacingError {
    /// Fewer than two positions, or all with the same value.
    #[error("expected at least two positions of different values, found {0}")]
    Positions(usize),
    /// Two positions or two joints of one name.
    #[error("expected each {what} once, found `{name}` twice")]
    Twice {
        /// Kind of thing: position or joint.
        what: &'static str,
        /// Their name.
        name: String,
    },
    /// A position whose number of values is not that of joints.
    #[error("position `{position}`: expected {expected}, found {found}")]
    Values {
        /// Name of the position.
        position: String,
        /// Expected values.
        expected: String,
        /// Values that it has.
        found: String,
    },
    /// A step's number is out of range.
    #[error("step {step}: expected {expected}, found {found}")]
    Step {
        /// The step, from 1.
        step: usize,
        /// Expected number.
        expected: String,
        /// Its number.
        found: String,
    },
    /// Too many steps.
    #[error("expected at most {MOST_STEPS} steps, found more")]
    Steps,
}

impl PacedStep {
    /// Returns the duration of move and hold, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.move_s + self.hold_s
    }

    /// Returns the start and end of the time in which the body is certainly held, s from the start of the step: a person is late,
    /// overshoots the mark, and may leave it early.
    #[must_use]
    pub fn held_s(&self) -> (f64, f64) {
        let settling_s = if self.move_s > 0.0 { SETTLING_S.min(SETTLING_SHARE * self.hold_s) } else { 0.0 };
        (self.move_s + settling_s, self.duration_s() - EARLY_S.min(EARLY_SHARE * self.hold_s))
    }
}

impl Pacing {
    /// Checks positions and steps.
    ///
    /// # Errors
    /// The first invalid position or step.
    pub fn validate(&self) -> Result<(), PacingError> {
        let first = self.positions.first();
        if self.positions.iter().all(|other| Some(&other.values) == first.map(|first| &first.values)) {
            return Err(PacingError::Positions(self.positions.len().min(1)));
        }
        let positions: Vec<&String> = self.positions.iter().map(|position| &position.name).collect();
        for (what, names) in [("position", positions), ("joint", self.joints.iter().collect())] {
            if let Some((_, name)) = names.iter().enumerate().find(|(place, name)| names[..*place].contains(name)) {
                return Err(PacingError::Twice { what, name: (*name).clone() });
            }
        }
        let expected = self.joints.len().max(1);
        for position in &self.positions {
            let is_number = |value: &f64| value.is_finite();
            let all = position.values.iter().chain([&position.sd]).all(is_number);
            if position.values.len() != expected || !all || position.sd <= 0.0 {
                let values =
                    if expected == 1 { "one value".into() } else { format!("{expected} values, one per joint") };
                return Err(PacingError::Values {
                    position: position.name.clone(),
                    expected: format!("{values}, and a positive standard deviation"),
                    found: format!("{:?} and {}", position.values, position.sd),
                });
            }
        }
        for (place, step) in self.steps.iter().enumerate() {
            let fault = |expected: &str, found: f64| PacingError::Step {
                step: place + 1,
                expected: expected.into(),
                found: found.to_string(),
            };
            let within = |seconds: f64| (0.0..=LONGEST_S).contains(&seconds);
            if step.to >= self.positions.len() {
                return Err(fault("a position of the protocol", step.to as f64));
            }
            if !within(step.move_s) || !within(step.hold_s) || step.duration_s() <= 0.0 {
                let wrong = if within(step.move_s) { step.hold_s } else { step.move_s };
                return Err(fault("0 to 100000 s for `move_s` and `hold_s`, one of them above 0", wrong));
            }
            if step.move_s == 0.0 && place > 0 && self.steps[place - 1].to != step.to {
                return Err(fault("time for the move from another position (`move_s`)", step.move_s));
            }
        }
        if self.steps.len() > MOST_STEPS { Err(PacingError::Steps) } else { Ok(()) }
    }

    /// Returns the duration of all steps, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps.iter().map(PacedStep::duration_s).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        let position = |name: &str, value: f64| Position { name: name.into(), values: vec![value; 2], sd: 0.01 };
        let (quantity, steps) = (ReferenceQuantity::Strain, Vec::new());
        let joints = vec!["index".to_owned(), "middle".to_owned()];
        let pacing = Pacing { quantity, joints, positions: vec![position("rest", 0.0), position("full", 0.2)], steps };
        assert_eq!(pacing.validate(), Ok(()));
        let mut twice = pacing.clone();
        twice.positions[1].name = "rest".into();
        assert_eq!(twice.validate(), Err(PacingError::Twice { what: "position", name: "rest".into() }));
        let mut twice = pacing;
        twice.joints[1] = "index".into();
        assert_eq!(twice.validate(), Err(PacingError::Twice { what: "joint", name: "index".into() }));
    }

    #[test]
    fn a_hold_is_certain_after_it_has_settled_and_before_it_ends() {
        let step = PacedStep { to: 1, move_s: 2.0, hold_s: 10.0 };
        assert_eq!(step.held_s(), (3.0, 11.7));
        let short = PacedStep { hold_s: 1.5, ..step };
        assert!((short.held_s().0 - 2.5).abs() < 1e-12 && (short.held_s().1 - 3.35).abs() < 1e-12);
        let rest = PacedStep { move_s: 0.0, ..step };
        assert_eq!(rest.held_s(), (0.0, 9.7));
    }
}
