//! Progress of a person through a protocol.

use std::collections::VecDeque;

use ohmstrain_bench_data::pacing::{PacedStep, Pacing};

/// Shortest duration of the move back to the start of a spoiled step, s, and duration of the hold there.
const BACK_S: f64 = 1.0;
const BACK_HOLD_S: f64 = 3.0;

/// A protocol that is being followed, on the clock of the readings.
pub struct Pacer {
    pacing: Pacing,
    ahead: VecDeque<PacedStep>,
    current: Option<Current>,
    /// Position of the body, or the one that it left last.
    place: Option<usize>,
    is_paused: bool,
    /// Position that a person has marked by hand.
    by_hand: Option<usize>,
}

/// A step that has begun.
#[derive(Clone, Copy)]
struct Current {
    step: PacedStep,
    from: Option<usize>,
    begun_s: f64,
}

/// Instruction for the present.
#[derive(Clone, Debug, PartialEq)]
pub struct Instruction {
    /// Action in words.
    pub text: String,
    /// Elapsed share of the action, 0 to 1.
    pub share: f64,
    /// Remaining time, s.
    pub left_s: f64,
}

impl Pacer {
    /// Creates a pacer at the start of a protocol.
    pub fn new(pacing: Pacing) -> Self {
        let ahead = pacing.steps.iter().copied().collect();
        Self { pacing, ahead, current: None, place: None, is_paused: false, by_hand: None }
    }

    /// The protocol.
    pub const fn pacing(&self) -> &Pacing {
        &self.pacing
    }

    /// True if every step has been made.
    pub fn is_done(&self) -> bool {
        !self.pacing.steps.is_empty() && self.ahead.is_empty() && self.current.is_none() && !self.is_paused
    }

    /// True if a step is under way, which can be spoiled.
    pub const fn is_in_step(&self) -> bool {
        self.current.is_some() && !self.is_paused
    }

    /// Returns the number of steps still to be made.
    pub fn left(&self) -> usize {
        self.ahead.len() + usize::from(self.current.is_some())
    }

    /// Advances to a time; returns true if a step has begun or ended.
    pub fn advance(&mut self, time_s: f64) -> bool {
        let mut has_changed = false;
        while !self.is_paused {
            let next_s = match &self.current {
                Some(current) if time_s < current.begun_s + current.step.duration_s() => break,
                Some(current) => current.begun_s + current.step.duration_s(),
                None => time_s,
            };
            if let Some(ended) = self.current.take() {
                self.place = Some(ended.step.to);
                has_changed = true;
            }
            let Some(step) = self.ahead.pop_front() else { break };
            self.current = Some(Current { step, from: self.place, begun_s: next_s });
            has_changed = true;
        }
        has_changed
    }

    /// Returns the position in which the body is certainly held at a time.
    pub fn held(&self, time_s: f64) -> Option<usize> {
        let paced = || {
            let current = self.current.as_ref()?;
            let (from_s, until_s) = current.step.held_s();
            (from_s..until_s).contains(&(time_s - current.begun_s)).then_some(current.step.to)
        };
        self.by_hand.or_else(paced)
    }

    /// Repeats a spoiled step: the body goes back to the step's start, and makes it again. Returns false if there is no step.
    pub fn repeat(&mut self, time_s: f64) -> bool {
        let Some(spoiled) = self.current.take() else { return false };
        // The first step has no start to go back to, and begins anew.
        let (step, from) = match spoiled.from {
            None => (spoiled.step, None),
            Some(from) => {
                self.ahead.push_front(spoiled.step);
                let back = PacedStep { to: from, move_s: spoiled.step.move_s.max(BACK_S), hold_s: BACK_HOLD_S };
                (back, Some(spoiled.step.to))
            }
        };
        self.current = Some(Current { step, from, begun_s: time_s });
        true
    }

    /// Pauses, which spoils the step, or resumes. Returns true if a step was spoiled.
    pub fn toggle_pause(&mut self, time_s: f64) -> bool {
        let spoiled = !self.is_paused && self.repeat(time_s);
        self.is_paused = !self.is_paused;
        self.by_hand = None;
        if let Some(current) = &mut self.current {
            current.begun_s = time_s;
        }
        spoiled
    }

    /// Marks that the body is held at a position from now on; the same position again ends the mark. Returns true if a step was
    /// spoiled.
    pub fn mark(&mut self, position: usize, time_s: f64) -> bool {
        if position >= self.pacing.positions.len() {
            return false;
        }
        let spoiled = !self.is_paused && !self.pacing.steps.is_empty() && self.toggle_pause(time_s);
        self.by_hand = if self.by_hand == Some(position) { None } else { Some(position) };
        spoiled
    }

    /// True if a hold is marked by hand now.
    pub const fn is_marked(&self) -> bool {
        self.by_hand.is_some()
    }

    /// Ends a hold that was marked by hand.
    pub const fn release(&mut self) {
        self.by_hand = None;
    }

    /// Returns the instruction for a time.
    pub fn instruction(&self, time_s: f64) -> Instruction {
        let plain = |text: String| Instruction { text, share: 0.0, left_s: 0.0 };
        let name = |position: usize| self.pacing.positions[position].name.as_str();
        if let Some(position) = self.by_hand {
            return plain(format!("held at {}; any key ends it", name(position)));
        }
        if self.is_paused {
            return plain("paused: space goes on".into());
        }
        let Some(current) = self.current else {
            return plain(if self.pacing.steps.is_empty() { "mark by hand".into() } else { "done".into() });
        };
        let gone_s = time_s - current.begun_s;
        let (what, time, from_s, until_s) = if gone_s < current.step.move_s {
            ("to", "in", 0.0, current.step.move_s)
        } else {
            ("hold", "for", current.step.move_s, current.step.duration_s())
        };
        let share = ((gone_s - from_s) / (until_s - from_s)).clamp(0.0, 1.0);
        let duration = ohmstrain::number::significant(until_s - from_s, 2);
        let text = format!("{what} {} {time} {duration} s", name(current.step.to));
        Instruction { text, share, left_s: (until_s - gone_s).max(0.0) }
    }

    /// Describes the step after this one.
    pub fn next(&self) -> Option<String> {
        let step = self.ahead.front()?;
        let name = &self.pacing.positions[step.to].name;
        Some(format!("{name} in {} s", ohmstrain::number::significant(step.move_s, 2)))
    }

    /// Returns the planned value of the first joint at a time not before now; `None` after the last step.
    pub fn planned(&self, time_s: f64) -> Option<f64> {
        let value = |position: usize| self.pacing.positions[position].values[0];
        let mut current = self.current?;
        let mut ahead = self.ahead.iter();
        while time_s >= current.begun_s + current.step.duration_s() {
            let (from, begun_s) = (Some(current.step.to), current.begun_s + current.step.duration_s());
            current = Current { step: *ahead.next()?, from, begun_s };
        }
        let to = value(current.step.to);
        let from = current.from.map_or(to, value);
        let share = ((time_s - current.begun_s) / current.step.move_s.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        Some(from + share * (to - from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ohmstrain_bench_data::ReferenceQuantity;
    use ohmstrain_bench_data::pacing::Position;

    fn pacer() -> Pacer {
        let position = |name: &str, value| Position { name: name.into(), values: vec![value], sd: 0.01 };
        let step = |to, move_s, hold_s| PacedStep { to, move_s, hold_s };
        Pacer::new(Pacing {
            quantity: ReferenceQuantity::Strain,
            joints: vec![],
            positions: vec![position("rest", 0.0), position("B", 0.2)],
            steps: vec![step(0, 0.0, 10.0), step(1, 2.0, 10.0), step(0, 2.0, 10.0)],
        })
    }

    #[test]
    fn steps_follow_the_clock_of_the_readings() {
        let mut pacer = pacer();
        assert!(pacer.advance(100.0) && !pacer.advance(109.9));
        assert_eq!((pacer.held(100.0), pacer.held(109.9)), (Some(0), None));
        assert!(pacer.advance(110.5));
        assert_eq!(pacer.instruction(110.5).text, "to B in 2 s");
        assert_eq!(pacer.planned(111.0), Some(0.1));
        assert_eq!((pacer.held(112.5), pacer.held(113.5)), (None, Some(1)));
        assert_eq!(pacer.instruction(113.0).left_s, 9.0);
        assert!(pacer.advance(200.0) && pacer.is_done());
        assert_eq!(pacer.held(200.0), None);
    }

    #[test]
    fn a_spoiled_step_goes_back_and_is_repeated() {
        let mut pacer = pacer();
        pacer.advance(0.0);
        pacer.advance(15.0);
        assert!(pacer.repeat(15.0));
        assert_eq!(pacer.instruction(15.0).text, "to rest in 2 s");
        assert_eq!((pacer.held(15.1), pacer.held(18.5)), (None, Some(0)));
        pacer.advance(20.5);
        assert_eq!(pacer.instruction(20.5).text, "to B in 2 s");
        assert_eq!(pacer.left(), 2);
        pacer.advance(32.5);
        assert_eq!(pacer.instruction(32.5).text, "to rest in 2 s");
    }

    #[test]
    fn the_first_step_begins_anew_if_it_is_spoiled() {
        let mut pacer = pacer();
        pacer.advance(0.0);
        assert!(pacer.repeat(8.0) && pacer.left() == 3);
        assert_eq!(pacer.instruction(8.0).text, "hold rest for 10 s");
        assert!(!pacer.advance(17.5) && pacer.advance(18.5));
        assert_eq!(pacer.instruction(18.5).text, "to B in 2 s");
    }

    #[test]
    fn a_mark_by_hand_pauses_the_protocol() {
        let mut pacer = pacer();
        pacer.advance(0.0);
        pacer.advance(15.0);
        assert!(pacer.mark(1, 15.0));
        assert_eq!((pacer.held(15.0), pacer.advance(900.0)), (Some(1), false));
        pacer.release();
        assert_eq!(pacer.held(900.0), None);
        assert!(!pacer.mark(7, 900.0) && !pacer.toggle_pause(901.0));
        assert_eq!(pacer.instruction(901.0).text, "to rest in 2 s");
    }
}
