use crate::correction::ReadingFeatures;
use crate::live::{Doubts, FaultWatch, Jumps, Repeats, RestFollower};

/// Fields of a state, by name: the numbers that a program in another language keeps from step to step.
pub trait Fields<T> {
    /// Passes all fields to the visitor.
    fn each(&mut self, see: &mut impl See<T>);
}

/// Visitor of the fields of a state, which may change them.
pub trait See<T> {
    /// Visits a number.
    fn number(&mut self, name: &'static str, number: &mut T);
    /// Visits a truth value.
    fn truth(&mut self, name: &'static str, truth: &mut bool);
    /// Visits numbers that may be missing.
    fn maybe<const K: usize>(&mut self, name: &'static str, numbers: &mut Option<[T; K]>);

    /// Visits a number that may be missing.
    fn maybe_one(&mut self, name: &'static str, number: &mut Option<T>)
    where
        T: Copy,
    {
        let mut numbers = number.map(|number| [number]);
        self.maybe(name, &mut numbers);
        *number = numbers.map(|[number]| number);
    }

    /// Visits a list of numbers of fixed length.
    fn numbers<const K: usize>(&mut self, name: &'static str, numbers: &mut [T; K]);
}

/// Implements [`Fields`] for states, with their field names.
macro_rules! fields {
    ($($state:ident { $($kind:ident $name:literal $($field:ident).+),+ $(,)? })+) => {
        $(impl<T: Copy> Fields<T> for $state<T> {
            fn each(&mut self, see: &mut impl See<T>) {
                $(see.$kind($name, &mut self.$($field).+);)+
            }
        })+
    };
}

fields! {
    Repeats {
        maybe_one "last" last,
        number "since_s" since_s,
        number "repeated_s" repeated_s,
        number "count" count,
    }
    Jumps {
        number "startling" startling,
        maybe_one "calm" calm,
    }
    ReadingFeatures {
        numbers "low_pass" low_passes,
        number "waited_s" waited_s,
        number "surprises" surprises,
        truth "waits" waits,
        maybe "feature" now,
    }
    RestFollower {
        number "off" off,
        number "home" home,
        truth "session_begun" has_begun,
        maybe_one "drawn_by" last,
        number "undrawn_s" since_s,
    }
    FaultWatch {
        maybe_one "used" last,
        number "moved" moved,
        number "fault" jump,
        number "fault_s" began_s,
        number "kept_s" kept_s,
    }
}

impl<T: Copy> Fields<T> for Doubts<T> {
    fn each(&mut self, see: &mut impl See<T>) {
        see.truth("runs", &mut self.runs);
        see.truth("starts", &mut self.starts);
        see.number("run_s", &mut self.run_s);
        see.number("fading", &mut self.fading);
        see.number("unread_s", &mut self.unread_s);
        see.truth("refused", &mut self.refused);
        see.maybe_one("believed", &mut self.believed);
        see.number("near_off", &mut self.misfit.near);
        see.number("far_off", &mut self.misfit.far);
        see.number("misfit", &mut self.misfit.innovations.mean);
        if let Some(rest) = &mut self.rest {
            see.truth("rests", &mut rest.rests);
            see.number("beyond_s", &mut rest.beyond_s);
            see.number("near_s", &mut rest.near_s);
            see.number("least", &mut rest.least);
            see.number("rest_off", &mut rest.off);
        }
        if let Some(turns) = &mut self.turns {
            see.number("direction", &mut turns.direction);
            see.maybe_one("farthest", &mut turns.farthest);
            see.number("since_farthest_s", &mut turns.since_farthest_s);
            see.number("since_turn_s", &mut turns.since_turn_s);
        }
    }
}
