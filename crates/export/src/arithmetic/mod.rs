//! The kernel's arithmetic as functions in C, printed from the operations that the kernel recorded.

mod around;
mod body;
mod correction;
mod function;
mod listed;

use std::collections::BTreeSet;
use std::fmt::Write;

use ohmstrain_ekf::record::{Carried, Operation, Piece, Recorded};
use ohmstrain_model::Phase;

pub use around::Around;
use body::{Body, uses_of_needed};
use function::{defined, either};
pub use listed::Lists;
use listed::{Slot, list};

/// A function to be printed.
struct Function {
    name: &'static str,
    comment: &'static str,
    piece: Piece,
    /// Parameters after the state, and targets of the results after those of the state.
    inputs: &'static [Input],
    outputs: &'static [&'static str],
    /// True if the function takes a state.
    has_state: bool,
    /// Name under which the last result is returned.
    returns: Returns,
}

/// A parameter after the state.
enum Input {
    Number(&'static str),
    /// Another state.
    State,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Returns {
    Nothing,
    Truth,
    Number,
}

impl Returns {
    const fn kind(self) -> &'static str {
        match self {
            Self::Nothing => "void",
            Self::Truth => "int",
            Self::Number => "float",
        }
    }
}

const MOVES: Function = Function {
    name: "",
    comment: "",
    piece: Piece::PredictOpen,
    inputs: &[],
    outputs: &[],
    has_state: true,
    returns: Returns::Nothing,
};

const TAKES: Function = Function {
    inputs: &[Input::Number("reading"), Input::Number("extra_variance")],
    outputs: &["innovation", "variance", "nis"],
    returns: Returns::Truth,
    ..MOVES
};

/// Functions of rates on a side of zero.
const SIDE: Function = Function { inputs: &[Input::Number("side")], ..MOVES };

/// A prediction and an update whose direction of motion is left to the rate's distribution.
const OPEN: [Function; 3] = [
    Function {
        name: "predict_open",
        comment: "Predicts over an interval, with a direction as uncertain as the rate.",
        ..MOVES
    },
    Function {
        name: "take_open",
        comment: "Updates with a relative reading. Returns true if the result is sound.",
        piece: Piece::Take(None),
        ..TAKES
    },
    SOUND,
];

const SOUND: Function = Function {
    name: "is_sound",
    comment: "True if all numbers are finite, and no variance is negative.",
    piece: Piece::Sound,
    returns: Returns::Truth,
    ..MOVES
};

/// Functions for doubts, hypotheses and corrections.
const FALLING: Function = Function {
    name: "falling",
    comment: "e^x for x <= 0: 2^n e^r with |r| <= ln(2)/2, and Taylor's series. The same bits on every processor.",
    piece: Piece::Falling,
    inputs: &[Input::Number("x")],
    has_state: false,
    returns: Returns::Number,
    ..MOVES
};

/// Functions for a hypothesis of a phase.
const PHASES: [Function; 13] = [
    Function {
        name: "predict_extend",
        comment: "Predicts over an interval of stretching.",
        piece: Piece::Predict(Phase::Extend),
        ..MOVES
    },
    Function {
        name: "predict_hold",
        comment: "Predicts over an interval at rest.",
        piece: Piece::Predict(Phase::Hold),
        ..MOVES
    },
    Function {
        name: "predict_retract",
        comment: "Predicts over an interval of releasing.",
        piece: Piece::Predict(Phase::Retract),
        ..MOVES
    },
    Function {
        name: "take_extend",
        comment: "Updates with a reading while stretching. Returns true if the result is sound.",
        piece: Piece::Take(Some(Phase::Extend)),
        ..TAKES
    },
    Function { name: "take_hold", comment: "The same at rest.", piece: Piece::Take(Some(Phase::Hold)), ..TAKES },
    Function {
        name: "take_retract",
        comment: "The same while releasing.",
        piece: Piece::Take(Some(Phase::Retract)),
        ..TAKES
    },
    SOUND,
    Function {
        name: "renew_rate",
        comment: "Replaces the rate by one that is independent of the other states.",
        piece: Piece::Renew,
        inputs: &[Input::Number("rate"), Input::Number("rate_variance")],
        ..MOVES
    },
    Function {
        name: "tail_above",
        comment: "Probability of a standard normal above a border; the density at the border over it is the hazard.",
        piece: Piece::Tail,
        inputs: &[Input::Number("border")],
        outputs: &["hazard"],
        has_state: false,
        returns: Returns::Number,
    },
    Function {
        name: "of_limits",
        comment: "Probability of the limits times per_inside, and its new inverse.",
        piece: Piece::OfLimits,
        inputs: &[Input::Number("per_inside"), Input::Number("lower"), Input::Number("upper")],
        outputs: &["more_inside", "per_inside_now"],
        ..MOVES
    },
    Function {
        name: "is_like",
        comment: "True if strain and rate are alike in another state.",
        piece: Piece::Alike,
        inputs: &[Input::State],
        returns: Returns::Truth,
        ..MOVES
    },
    Function {
        name: "distance_of",
        comment: "Squared distance of strains and rates, each in units of the larger variance.",
        piece: Piece::Distance,
        inputs: &[Input::State],
        returns: Returns::Number,
        ..MOVES
    },
    Function {
        name: "merge_states",
        comment: "Merges with another state, preserving the mean and covariance of the pair.",
        piece: Piece::Merge,
        inputs: &[Input::State, Input::Number("mine"), Input::Number("theirs")],
        ..MOVES
    },
];

/// Functions for splitting by the rate's sign.
const SPLITS: [Function; 7] = [
    Function {
        name: "predict_open",
        comment: "Predicts over an interval, with a direction as uncertain as the rate.",
        ..MOVES
    },
    Function {
        name: "predict_extend_turning",
        comment: "Predicts over an interval that ends stretching; the rate may change its sign within it.",
        piece: Piece::PredictTurning(Phase::Extend),
        inputs: &[Input::Number("excess"), Input::Number("turning_variance")],
        ..MOVES
    },
    Function {
        name: "predict_retract_turning",
        comment: "The same, ending with release.",
        piece: Piece::PredictTurning(Phase::Retract),
        inputs: &[Input::Number("excess"), Input::Number("turning_variance")],
        ..MOVES
    },
    Function {
        name: "is_hopeless",
        comment: "True if a side of zero, 1 or -1, has a negligible part of a prediction.",
        piece: Piece::Hopeless,
        returns: Returns::Truth,
        ..SIDE
    },
    Function {
        name: "turning_of",
        comment: "Path beyond the net movement, for a rate that may change its sign within the step, and its variance.",
        piece: Piece::Turns,
        outputs: &["excess", "turning_variance"],
        ..SIDE
    },
    Function {
        name: "is_uncertain_of_side",
        comment: "True if the rate may have either sign; otherwise its share on a side of zero is 0 or 1.",
        piece: Piece::CertainOfSide,
        outputs: &["certain"],
        returns: Returns::Truth,
        ..SIDE
    },
    Function {
        name: "cut_off",
        comment: "Truncates the rate to a side of zero; returns the probability of that side.",
        piece: Piece::CutOff,
        returns: Returns::Number,
        ..SIDE
    },
];

/// Returns the functions of an extended Kalman filter, each also as a list if there are lists.
pub fn of_ekf(
    lists: Option<&mut Lists>,
    carried: Carried,
    steps: &[String],
    record: impl Fn(Piece) -> Recorded,
) -> String {
    let Some(lists) = lists else { return printed(&[&OPEN], (carried, steps), record) };
    let kept = steps_of_ekf(carried, &record);
    let functions = [FALLING].iter().chain(&OPEN);
    let text = |function: &Function| function.either((carried, steps), &kept, &record(function.piece), lists);
    functions.map(text).collect::<Vec<_>>().join("\n")
}

/// Returns the indices of the numbers of a step that an extended Kalman filter needs.
pub fn steps_of_ekf(carried: Carried, record: impl Fn(Piece) -> Recorded) -> Vec<usize> {
    let mut needed = BTreeSet::new();
    for function in &OPEN {
        let recorded = record(function.piece);
        let first = carried.means + carried.covariances + function.names_of_inputs(carried).len();
        let uses = uses_of_needed(&recorded.operations, &recorded.results);
        needed.extend(recorded.operations.iter().zip(uses).filter_map(|(operation, uses)| match operation {
            Operation::Input(input) if uses > 0 => input.checked_sub(first),
            _ => None,
        }));
    }
    needed.into_iter().collect()
}

/// Returns the functions of a filter of hypotheses; `splits` is true if these are split by the sign of the rate.
pub fn of_hypotheses(splits: bool, carried: Carried, steps: &[String], record: impl Fn(Piece) -> Recorded) -> String {
    printed(&[&PHASES, if splits { &SPLITS } else { &[] }], (carried, steps), record)
}

fn printed(functions: &[&[Function]], state: (Carried, &[String]), record: impl Fn(Piece) -> Recorded) -> String {
    let functions = [FALLING].iter().chain(functions.iter().copied().flatten());
    functions.map(|function| function.text(state, &record(function.piece))).collect::<Vec<_>>().join("\n")
}

impl Function {
    /// Returns the function as a list, and compiled.
    fn either(&self, state: (Carried, &[String]), steps: &[usize], recorded: &Recorded, lists: &mut Lists) -> String {
        either(self.listed(state.0, steps, recorded, lists), self.text(state, recorded))
    }

    /// Returns the function as a list, if it is worth one. Only the numbers of a step with these indices are available.
    fn listed(&self, carried: Carried, steps: &[usize], recorded: &Recorded, lists: &mut Lists) -> Option<String> {
        let state = if self.has_state { carried.means + carried.covariances } else { 0 };
        let inputs = self.names_of_inputs(carried);
        let slot_of = |input: usize| match input {
            input if input < state => Slot::Number(input),
            input if input < state + inputs.len() => Slot::Given(input - state),
            input => Slot::Step(steps.binary_search(&(input - state - inputs.len())).unwrap_or(usize::MAX)),
        };
        let own = if self.piece.changes_state() { state } else { 0 };
        let slots = (0..own).map(Slot::Number).chain((inputs.len()..).map(Slot::Given));
        let is_new = |k: usize, place: usize| k >= own || recorded.operations[place] != Operation::Input(k);
        let kept = recorded.results.iter().copied().zip(slots).enumerate();
        let kept: Vec<_> = kept.filter(|(k, (place, _))| is_new(*k, *place)).map(|(_, result)| result).collect();
        let lists_of = list(lists, recorded, &slot_of, &kept)?;
        let takes_step = recorded
            .operations
            .iter()
            .any(|operation| matches!(operation, Operation::Input(input) if *input >= state + inputs.len()));
        let mut body = format!("{lists_of}    cell given[{}];\n", (recorded.results.len() - own + inputs.len()).max(1));
        for (k, name) in inputs.iter().enumerate() {
            let _ = writeln!(body, "    given[{k}].number = {name};");
        }
        if self.has_state {
            body.push_str("    (void)p; /* which follows x */\n");
        }
        let x = if self.has_state { "(float *)x" } else { "0" };
        let step = if takes_step { "s" } else { "0" };
        let _ = writeln!(body, "    run_list(OPERATIONS, CONSTANTS, {x}, 0, {step}, given);");
        for (k, name) in self.outputs.iter().enumerate() {
            let _ = writeln!(body, "    *{name} = given[{}].number;", inputs.len() + k);
        }
        let last = inputs.len() + self.outputs.len();
        match self.returns {
            Returns::Nothing => {}
            Returns::Truth => drop(writeln!(body, "    return given[{last}].truth;")),
            Returns::Number => drop(writeln!(body, "    return given[{last}].number;")),
        }
        let name = format!("{} {}", self.returns.kind(), self.name);
        Some(defined(self.comment, &name, &self.parameters(takes_step), &body))
    }

    fn text(&self, (carried, steps): (Carried, &[String]), recorded: &Recorded) -> String {
        let (state, changes) = (carried.means + carried.covariances, self.piece.changes_state());
        let inputs = self.names_of_inputs(carried);
        let of_step = state + inputs.len();
        let name_of = |input: usize| match input {
            input if input < state => entry(["x", "p"], carried, input),
            input if input < of_step => inputs[input - state].clone(),
            input => format!("s[{}]", steps.get(input - of_step).map_or("0", String::as_str)),
        };
        let own = (0..if changes { state } else { 0 }).map(name_of);
        let targets: Vec<String> = own.chain(self.outputs.iter().map(|name| format!("*{name}"))).collect();
        let mut body = Body::new(recorded, &name_of);
        let is_of_step = |(place, operation): (usize, &Operation)| {
            matches!(operation, Operation::Input(input) if *input >= of_step) && body.uses[place] > 0
        };
        let parameters = self.parameters(recorded.operations.iter().enumerate().any(is_of_step));
        let mut results = String::new();
        for (k, (target, place)) in targets.iter().zip(&recorded.results).enumerate() {
            // An unchanged number need not be written.
            if !(changes && recorded.operations[*place] == Operation::Input(k)) {
                let _ = writeln!(results, "    {target} = {};", body.value(*place));
            }
        }
        if let Some(place) = recorded.results.last().filter(|_| self.returns != Returns::Nothing) {
            let _ = writeln!(results, "    return {};", body.value(*place));
        }
        let kind = self.returns.kind();
        defined(self.comment, &format!("{kind} {}", self.name), &parameters, &format!("{}{results}", body.lines))
    }

    fn parameters(&self, takes_step: bool) -> Vec<String> {
        let constant = if self.piece.changes_state() { "" } else { "const " };
        let mut all = Vec::new();
        if self.has_state {
            all.extend([format!("{constant}float x[STATES]"), format!("{constant}float p[ENTRIES]")]);
        }
        for input in self.inputs {
            match input {
                Input::Number(name) => all.push(format!("float {name}")),
                Input::State => {
                    all.extend(["const float y[STATES]".to_owned(), "const float q[ENTRIES]".to_owned()]);
                }
            }
        }
        all.extend(self.outputs.iter().map(|name| format!("float *{name}")));
        all.extend(takes_step.then(|| "const float s[STEP]".to_owned()));
        all
    }

    /// Returns the names of the inputs between state and step.
    fn names_of_inputs(&self, carried: Carried) -> Vec<String> {
        let state = carried.means + carried.covariances;
        let names = |input: &Input| match input {
            Input::Number(name) => vec![(*name).to_owned()],
            Input::State => (0..state).map(|number| entry(["y", "q"], carried, number)).collect(),
        };
        self.inputs.iter().flat_map(names).collect()
    }
}

/// Returns the name of a number of a state with these names of means and covariances.
fn entry([means, covariances]: [&str; 2], carried: Carried, number: usize) -> String {
    match number.checked_sub(carried.means) {
        None => format!("{means}[{number}]"),
        Some(number) => format!("{covariances}[{number}]"),
    }
}
