use std::string::String;
use std::vec::Vec;
use std::{format, vec};

use super::{Expression, Fields, Operation, Place, Recorded, See, Tape};

/// A function recorded for all its paths, with named inputs and results.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// Names of its inputs, by index.
    pub inputs: Vec<Name>,
    /// Names of its results, in the order of [`Recorded::results`].
    pub results: Vec<Name>,
    /// Recorded operations.
    pub recorded: Recorded,
}

/// Name of a number or truth value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Name {
    /// Name of a state's field.
    Field(String),
    /// Name of an argument or a result.
    Own(String),
}

/// Writer of a function's inputs and results while it runs along one of its paths.
pub struct Writer<'t> {
    tape: &'t Tape,
    inputs: &'t core::cell::RefCell<Vec<Name>>,
    results: Vec<(Name, Place)>,
}

impl<'t> Writer<'t> {
    /// Returns the index of an input.
    fn number_of(&self, name: Name) -> usize {
        let mut inputs = self.inputs.borrow_mut();
        let number = inputs.iter().position(|known| *known == name).unwrap_or(inputs.len());
        if number == inputs.len() {
            inputs.push(name);
        }
        number
    }

    /// Returns an input number.
    #[must_use]
    pub fn input(&self, name: &str) -> Expression<'t> {
        self.tape.input(self.number_of(Name::Own(name.into())))
    }

    /// Returns `K` input numbers, passed as a list.
    #[must_use]
    pub fn inputs<const K: usize>(&self, name: &str) -> [Expression<'t>; K] {
        core::array::from_fn(|k| self.input(&format!("{name}[{k}]")))
    }

    /// Returns an input truth value.
    #[must_use]
    pub fn truth(&self, name: &str) -> bool {
        self.tape.ask(Operation::Flag(self.number_of(Name::Own(name.into()))))
    }

    /// Returns the state with its fields at run time.
    #[must_use]
    pub fn state<S: Fields<Expression<'t>>>(&self, mut state: S) -> S {
        state.each(&mut Read(self));
        state
    }

    /// Writes the new state as results.
    pub fn keep<S: Fields<Expression<'t>>>(&mut self, mut state: S) {
        state.each(&mut Keep(self));
    }

    /// Adds a number to the results.
    pub fn give(&mut self, name: &str, number: Expression<'t>) {
        self.results.push((Name::Own(name.into()), number.place_on(self.tape)));
    }

    /// Adds a truth value to the results.
    pub fn tell(&mut self, name: &str, truth: bool) {
        self.results.push((Name::Own(name.into()), self.tape.place(Operation::Known(truth))));
    }
}

/// Name of the presence flag of an optional number.
fn presence(name: &str) -> Name {
    Name::Field(format!("has_{name}"))
}

/// Returns the names of a field that is a single number or a list.
fn fields<const K: usize>(name: &str) -> [Name; K] {
    core::array::from_fn(|k| Name::Field(if K == 1 { name.into() } else { format!("{name}[{k}]") }))
}

/// Puts inputs into the fields of a state.
struct Read<'a, 't>(&'a Writer<'t>);

impl<'t> See<Expression<'t>> for Read<'_, 't> {
    fn number(&mut self, name: &'static str, number: &mut Expression<'t>) {
        *number = self.0.tape.input(self.0.number_of(Name::Field(name.into())));
    }

    fn truth(&mut self, name: &'static str, truth: &mut bool) {
        *truth = self.0.tape.ask(Operation::Flag(self.0.number_of(Name::Field(name.into()))));
    }

    fn maybe<const K: usize>(&mut self, name: &'static str, numbers: &mut Option<[Expression<'t>; K]>) {
        let has = self.0.tape.ask(Operation::Flag(self.0.number_of(presence(name))));
        *numbers = has.then(|| fields(name).map(|field| self.0.tape.input(self.0.number_of(field))));
    }

    fn numbers<const K: usize>(&mut self, name: &'static str, numbers: &mut [Expression<'t>; K]) {
        *numbers = fields(name).map(|field| self.0.tape.input(self.0.number_of(field)));
    }
}

/// Takes results from the fields of a state.
struct Keep<'a, 't>(&'a mut Writer<'t>);

impl<'t> See<Expression<'t>> for Keep<'_, 't> {
    fn number(&mut self, name: &'static str, number: &mut Expression<'t>) {
        self.0.results.push((Name::Field(name.into()), number.place_on(self.0.tape)));
    }

    fn truth(&mut self, name: &'static str, truth: &mut bool) {
        self.0.results.push((Name::Field(name.into()), self.0.tape.place(Operation::Known(*truth))));
    }

    /// Keeps the old values of missing numbers.
    fn maybe<const K: usize>(&mut self, name: &'static str, numbers: &mut Option<[Expression<'t>; K]>) {
        self.0.results.push((presence(name), self.0.tape.place(Operation::Known(numbers.is_some()))));
        for (k, field) in fields::<K>(name).into_iter().enumerate() {
            let before = Operation::Input(self.0.number_of(field.clone()));
            let place = numbers.map_or_else(|| self.0.tape.place(before), |numbers| numbers[k].place_on(self.0.tape));
            self.0.results.push((field, place));
        }
    }

    fn numbers<const K: usize>(&mut self, name: &'static str, numbers: &mut [Expression<'t>; K]) {
        let all = fields::<K>(name).into_iter().zip(numbers);
        self.0.results.extend(all.map(|(field, number)| (field, number.place_on(self.0.tape))));
    }
}

/// Runs a function once for every possible path, and records the results that each question selects.
///
/// ```
/// use ohmstrain_ekf::record::{Operation, write_down};
///
/// // The larger one of two, by a way for each.
/// let larger = write_down(|writer| {
///     let (a, b) = (writer.input("a"), writer.input("b"));
///     writer.give("larger", if a < b { b } else { a });
/// });
/// assert!(matches!(larger.recorded.operations[larger.recorded.results[0]], Operation::Pick(..)));
/// ```
pub fn write_down(function: impl for<'t> Fn(&mut Writer<'t>)) -> Function {
    let (tape, inputs) = (Tape::default(), core::cell::RefCell::new(Vec::new()));
    let results = of_ways(&tape, &inputs, &function, &[]);
    let (results, places): (Vec<_>, Vec<_>) = results.into_iter().unzip();
    let recorded = Recorded { results: places, ..tape.recorded([]) };
    let inputs = inputs.into_inner();
    Function { inputs, results, recorded }
}

/// Returns the results of all paths that begin with these answers.
fn of_ways<'t>(
    tape: &'t Tape,
    inputs: &'t core::cell::RefCell<Vec<Name>>,
    function: &impl Fn(&mut Writer<'t>),
    answers: &[bool],
) -> Vec<(Name, Place)> {
    tape.answer(answers);
    let mut writer = Writer { tape, inputs, results: Vec::new() };
    function(&mut writer);
    let asked = tape.asked();
    let mut results = writer.results;
    // Questions without an answer were answered with true.
    for number in (answers.len()..asked.len()).rev() {
        let mut other_way = vec![true; number + 1];
        other_way[..answers.len()].copy_from_slice(answers);
        other_way[number] = false;
        let others = of_ways(tape, inputs, function, &other_way);
        for ((_, yes), (_, no)) in results.iter_mut().zip(others) {
            *yes = tape.choose(asked[number], *yes, no);
        }
    }
    results
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::format;
    use std::string::String;
    use std::vec::Vec;

    use super::{Function, Name, write_down};
    use crate::correction::{FeatureScale, ReadingFeatures};
    use crate::live::{
        DoubtParts, Doubts, Flag, Jumps, Repeats, RestBounds, RestFollower, RestSeen, SessionStart, Sieve, TurnSeen,
        Unread,
    };
    use crate::record::tests::run;
    use crate::record::{Fields, See};
    use crate::{Gaussian, Reading};

    /// Fields of a state as numbers: a missing value has no entry, truth values are 1 and 0.
    #[derive(Default)]
    struct Seen(HashMap<String, f32>);

    impl Seen {
        fn of(mut state: impl Fields<f32>) -> HashMap<String, f32> {
            let mut seen = Self::default();
            state.each(&mut seen);
            seen.0
        }
    }

    impl See<f32> for Seen {
        fn number(&mut self, name: &'static str, number: &mut f32) {
            self.0.insert(name.into(), *number);
        }

        fn truth(&mut self, name: &'static str, truth: &mut bool) {
            self.0.insert(name.into(), f32::from(u8::from(*truth)));
        }

        fn maybe<const K: usize>(&mut self, name: &'static str, numbers: &mut Option<[f32; K]>) {
            self.0.insert(format!("has_{name}"), f32::from(u8::from(numbers.is_some())));
            if let Some(numbers) = numbers {
                self.numbers(name, numbers);
            }
        }

        fn numbers<const K: usize>(&mut self, name: &'static str, numbers: &mut [f32; K]) {
            for (k, number) in numbers.iter().enumerate() {
                self.0.insert(if K == 1 { name.into() } else { format!("{name}[{k}]") }, *number);
            }
        }
    }

    /// Runs a recorded function with a state and inputs; returns the new state, and the results.
    fn done(function: &Function, state: &HashMap<String, f32>, own: &[(&str, f32)]) -> [HashMap<String, f32>; 2] {
        let of = |name: &Name| match name {
            Name::Field(field) => state.get(field).copied().unwrap_or(f32::NAN),
            Name::Own(wanted) => own.iter().find(|(name, _)| name == wanted).map_or(f32::NAN, |(_, value)| *value),
        };
        let inputs: Vec<f32> = function.inputs.iter().map(of).collect();
        let mut after = [state.clone(), HashMap::new()];
        for (name, result) in function.results.iter().zip(run(&function.recorded, &inputs)) {
            match name {
                Name::Field(field) => after[0].insert(field.clone(), result),
                Name::Own(own) => after[1].insert(own.clone(), result),
            };
        }
        after
    }

    /// Checks that a state has these bits; a missing number may be anything.
    fn assert_same(found: &HashMap<String, f32>, expected: &HashMap<String, f32>, row: usize) {
        for (name, number) in expected {
            assert_eq!(found[name].to_bits(), number.to_bits(), "row {row}, {name}: {} for {number}", found[name]);
        }
    }

    /// Readings with a spike, a repeated number, and some that stay beyond either end of their range.
    fn readings() -> impl Iterator<Item = (usize, f32, f32)> {
        (0..400_u16).map(|k| {
            let t = f32::from(k);
            let rho = match k {
                50..70 => 0.7,
                120 => 40.0,
                150..260 => 1.6 + 0.001 * t,
                300..340 => -0.1 - 1e-4 * t,
                _ => 0.5 + 0.45 * (0.11 * t).sin(),
            };
            (usize::from(k), rho, if k % 37 == 0 || k == 121 { 30.0 } else { 0.6 + (0.3 * t).cos() })
        })
    }

    fn parts() -> DoubtParts<f64> {
        let unread = Unread { rate_time_s: 1.0, path_variance: 1e-3, centre: 0.15, anywhere: 0.3 * 0.3 / 12.0 };
        DoubtParts {
            low: 0.1,
            high: 0.9,
            fastest_per_s: 0.2,
            longest_s: 30.0,
            per_reading: 0.3,
            start: 1e-4,
            most: unread.anywhere,
            unstated: 1e-4,
            unread,
            rest: Some(RestSeen { rested: 0.1, tolerance: 0.02, lasts_s: 2.0, sign: 1.0, end: 0.1 }),
            turns: Some(TurnSeen { turn: 0.1, longest_s: 4.0 }),
        }
    }

    #[test]
    fn what_becomes_of_a_reading_is_written_down_for_all_its_ways() {
        let sieve = Sieve {
            plausible: (-0.5, 5.0),
            longest_repeat_s: 1.2,
            most_repeats: 10.0,
            fine_variance: 1e-4,
            jump: 0.08,
            error_time_s: 2.0,
        };
        let function = write_down(|writer| {
            let mut repeats = writer.state(Repeats::none());
            repeats.pass(writer.input("dt_s"));
            let reading = Reading { value: writer.input("rho"), extra_variance: writer.input("extra") };
            let sieved = repeats.sieved(&sieve.to(), reading, ohmstrain_model::Number::of(1e-4));
            writer.keep(repeats);
            writer.tell("is_seen", sieved.is_ok());
            writer.give("variance", sieved.map_or(reading.extra_variance, |seen| seen.extra_variance));
        });
        let mut verdicts = [0, 0];
        for extra in [0.0, 1e-5] {
            let mut repeats = Repeats::<f32>::none();
            for (row, value, _) in readings() {
                let before = Seen::of(repeats);
                repeats.pass(0.1);
                let sieved = repeats.sieved(&sieve.to(), Reading { value, extra_variance: extra }, 1e-4);
                let [after, given] = done(&function, &before, &[("dt_s", 0.1), ("rho", value), ("extra", extra)]);
                assert_same(&after, &Seen::of(repeats), row);
                assert_eq!(given["is_seen"] == 1.0, sieved.is_ok(), "row {row}");
                assert_eq!(given["variance"], sieved.map_or(extra, |seen| seen.extra_variance), "row {row}");
                verdicts[usize::from(sieved.is_ok())] += 1;
            }
        }
        assert!(verdicts[0] > 5 && verdicts[1] > 300, "{verdicts:?}");
    }

    #[test]
    fn doubts_are_written_down_for_all_their_ways() {
        let pauses = write_down(|writer| {
            let mut doubts = writer.state(Doubts::new(parts().to()));
            doubts.pass(writer.input("dt_s"));
            let stated = Gaussian { mean: writer.input("strain"), variance: writer.input("variance") };
            let open = doubts.open(stated);
            writer.keep(doubts);
            writer.give("open", open);
        });
        let turns = write_down(|writer| {
            let mut doubts = writer.state(Doubts::new(parts().to()));
            doubts.watch_turns(writer.input("rho"));
            writer.keep(doubts);
        });
        let reads = write_down(|writer| {
            let mut doubts = writer.state(Doubts::new(parts().to()));
            doubts.read(writer.input("rho"), writer.input("nis"));
            writer.keep(doubts);
        });
        let widens = write_down(|writer| {
            let doubts = writer.state(Doubts::new(parts().to()));
            let stated = Gaussian { mean: writer.input("strain"), variance: writer.input("variance") };
            let (variance, flags) = doubts.widened(stated, writer.input("rate"));
            writer.give("variance", variance);
            Flag::ALL.into_iter().for_each(|flag| writer.tell(flag.name(), flags.has(flag)));
        });
        let (mut doubts, stated) = (Doubts::<f32>::new(parts().to()), Gaussian { mean: 0.1, variance: 1e-5 });
        let mut raised = HashMap::new();
        for (row, rho, nis) in readings() {
            if (270..300).contains(&row) {
                if row == 280 {
                    doubts.refuse();
                }
                let before = Seen::of(doubts);
                let open = doubts.see(0.1, None, stated);
                let own = [("dt_s", 0.1), ("strain", stated.mean), ("variance", stated.variance)];
                let [after, given] = done(&pauses, &before, &own);
                assert_same(&after, &Seen::of(doubts), row);
                assert_eq!(given["open"], open, "row {row}");
            } else {
                doubts.pass(0.1);
                let before = Seen::of(doubts);
                doubts.watch_turns(rho);
                let [after, _] = done(&turns, &before, &[("rho", rho)]);
                assert_same(&after, &Seen::of(doubts), row);
                let before = Seen::of(doubts);
                doubts.read(rho, nis);
                let [after, _] = done(&reads, &before, &[("rho", rho), ("nis", nis)]);
                assert_same(&after, &Seen::of(doubts), row);
            }
            let rate = if row % 5 == 0 { 0.4 } else { -0.05 };
            let (variance, flags) = doubts.widened(stated, rate);
            let [_, given] = done(
                &widens,
                &Seen::of(doubts),
                &[("strain", stated.mean), ("rate", rate), ("variance", stated.variance)],
            );
            assert_eq!(given["variance"], variance, "row {row}");
            for flag in Flag::ALL {
                assert_eq!(given[flag.name()] == 1.0, flags.has(flag), "row {row}, {flag:?}");
                *raised.entry(flag.name()).or_insert(0) += u32::from(flags.has(flag));
            }
        }
        for flag in [Flag::StartUp, Flag::Recovering, Flag::Extrapolated, Flag::LongRun, Flag::RestMoved] {
            assert!(raised[flag.name()] > 0, "{flag:?}");
        }
    }

    #[test]
    fn an_r0_that_follows_jumps_and_features_are_written_down_for_all_their_ways() {
        let bounds =
            RestBounds { low: Some(0.1), high: Some(0.9), start: Some(SessionStart { reading: 0.2, weight: 0.7 }) };
        let rates = [0.03, 0.02];
        let scale = FeatureScale { centre: 0.5, half_range: 0.5, rates, starts: [[0.1, 0.8]; 6] };
        let follows = write_down(|writer| {
            let mut follower = writer.state(RestFollower::new(bounds.to()));
            follower.see(writer.input("dt_s"), writer.input("rho"));
            writer.keep(follower);
        });
        let jumps = write_down(|writer| {
            let mut jumps = writer.state(Jumps::none());
            let jump = jumps.see(writer.input("rho"), writer.input("nis"), writer.input("farthest"));
            writer.keep(jumps);
            writer.tell("has_jumped", jump.is_some());
        });
        let watches = write_down(|writer| {
            let mut features = writer.state(ReadingFeatures::new(scale.to()));
            let reading = writer.truth("is_read").then(|| writer.input("rho"));
            features.step_unless(writer.truth("surprises"), writer.input("dt_s"), reading);
            writer.keep(features);
        });
        let truth = |truth: bool| f32::from(u8::from(truth));
        let (mut follower, mut jumped, mut features) =
            (RestFollower::<f32>::new(bounds.to()), Jumps::<f32>::none(), ReadingFeatures::<f32>::new(scale.to()));
        for (row, rho, nis) in readings() {
            let (before, before_jump, before_features) = (Seen::of(follower), Seen::of(jumped), Seen::of(features));
            follower.see(0.1, rho);
            assert_same(&done(&follows, &before, &[("dt_s", 0.1), ("rho", rho)])[0], &Seen::of(follower), row);
            let jump = jumped.see(rho, nis, 0.08);
            let [after, given] = done(&jumps, &before_jump, &[("rho", rho), ("nis", nis), ("farthest", 0.08)]);
            assert_same(&after, &Seen::of(jumped), row);
            assert_eq!(given["has_jumped"] == 1.0, jump.is_some(), "row {row}");
            let (is_read, surprises) = (row % 7 != 3, nis > 9.0);
            features.step_unless(surprises, 0.1, is_read.then_some(rho));
            let own = [("is_read", truth(is_read)), ("surprises", truth(surprises)), ("dt_s", 0.1), ("rho", rho)];
            assert_same(&done(&watches, &before_features, &own)[0], &Seen::of(features), row);
        }
        assert!(follower.off() != 0.0);
    }
}
