//! The kernel's arithmetic as functions in C, printed from what the kernel itself wrote down.

mod body;

use std::fmt::Write;

use ohmstrain_ekf::record::{Carried, Operation, Piece, Recorded};
use ohmstrain_model::Phase;

use body::Body;

/// Inputs between the state and the step.
const MORE: usize = 2;

/// A function to be printed.
struct Function {
    name: &'static str,
    comment: &'static str,
    piece: Piece,
    /// Parameters after the state, and what the results after the state's are written to.
    inputs: &'static [&'static str],
    outputs: &'static [&'static str],
    /// Whether the state comes out, and whether the last result is returned as a truth.
    changes_state: bool,
    is_truth: bool,
}

const MOVES: Function = Function {
    name: "",
    comment: "",
    piece: Piece::PredictOpen,
    inputs: &[],
    outputs: &[],
    changes_state: true,
    is_truth: false,
};

const TAKES: Function = Function {
    inputs: &["reading", "extra_variance"],
    outputs: &["*innovation", "*variance", "*nis"],
    is_truth: true,
    ..MOVES
};

/// A prediction and an update whose direction is left to the rate's distribution.
const OPEN: [Function; 3] = [
    Function { name: "predict_open", comment: "One interval on; the direction is as uncertain as the rate.", ..MOVES },
    Function {
        name: "take_open",
        comment: "Takes a reading, relative to the rest reading. Returns whether all is sound.",
        piece: Piece::Take(None),
        ..TAKES
    },
    SOUND,
];

const SOUND: Function = Function {
    name: "is_sound",
    comment: "Whether nothing is infinite or no number, and no variance negative.",
    piece: Piece::Sound,
    changes_state: false,
    is_truth: true,
    ..MOVES
};

/// What a hypothesis of a phase needs.
const PHASES: [Function; 7] = [
    Function {
        name: "predict_extend",
        comment: "One interval on, stretching.",
        piece: Piece::Predict(Phase::Extend),
        ..MOVES
    },
    Function {
        name: "predict_hold",
        comment: "One interval on, at rest.",
        piece: Piece::Predict(Phase::Hold),
        ..MOVES
    },
    Function {
        name: "predict_retract",
        comment: "One interval on, releasing.",
        piece: Piece::Predict(Phase::Retract),
        ..MOVES
    },
    Function {
        name: "take_extend",
        comment: "Takes a reading while stretching. Returns whether all is sound.",
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
];

/// What splitting by the rate's sign needs besides.
const SPLITS: [Function; 8] = [
    Function { name: "predict_open", comment: "One interval on; the direction is as uncertain as the rate.", ..MOVES },
    Function {
        name: "predict_extend_turning",
        comment: "One interval on, stretching in the end, where the rate may have turned around on the way.",
        piece: Piece::PredictTurning(Phase::Extend),
        inputs: &["excess", "turning_variance"],
        ..MOVES
    },
    Function {
        name: "predict_retract_turning",
        comment: "The same, releasing in the end.",
        piece: Piece::PredictTurning(Phase::Retract),
        inputs: &["excess", "turning_variance"],
        ..MOVES
    },
    Function {
        name: "regress",
        comment: "Moves the rate by so many of its variances, everything else along its regression.",
        piece: Piece::Regress,
        inputs: &["moves", "narrows"],
        ..MOVES
    },
    Function {
        name: "rate_ahead_extend",
        comment: "The rate that stretching leads to.",
        piece: Piece::RateAhead(Phase::Extend),
        outputs: &["*mean", "*variance"],
        changes_state: false,
        ..MOVES
    },
    Function {
        name: "rate_ahead_retract",
        comment: "The rate that releasing leads to.",
        piece: Piece::RateAhead(Phase::Retract),
        outputs: &["*mean", "*variance"],
        changes_state: false,
        ..MOVES
    },
    Function {
        name: "rate_change_extend",
        comment: "How a rate above zero changes in one interval: away from zero, and the variance of that.",
        piece: Piece::RateChange(Phase::Extend),
        outputs: &["*expected", "*spread"],
        changes_state: false,
        ..MOVES
    },
    Function {
        name: "rate_change_retract",
        comment: "The same of a rate below zero.",
        piece: Piece::RateChange(Phase::Retract),
        outputs: &["*expected", "*spread"],
        changes_state: false,
        ..MOVES
    },
];

/// The functions of an extended Kalman filter.
pub fn of_ekf(carried: Carried, steps: &[String], record: impl Fn(Piece) -> Recorded) -> String {
    printed(&[&OPEN], (carried, steps), record)
}

/// The functions of a filter of hypotheses; `splits` if by the sign of the rate.
pub fn of_hypotheses(splits: bool, carried: Carried, steps: &[String], record: impl Fn(Piece) -> Recorded) -> String {
    printed(&[&PHASES, if splits { &SPLITS } else { &[] }], (carried, steps), record)
}

fn printed(functions: &[&[Function]], state: (Carried, &[String]), record: impl Fn(Piece) -> Recorded) -> String {
    let functions = functions.iter().copied().flatten();
    functions.map(|function| function.text(state, &record(function.piece))).collect::<Vec<_>>().join("\n")
}

impl Function {
    fn text(&self, (carried, steps): (Carried, &[String]), recorded: &Recorded) -> String {
        let Carried { means, covariances } = carried;
        let more = means + covariances;
        let constant = if self.changes_state { "" } else { "const " };
        let mut parameters = format!("{constant}float x[STATES], {constant}float p[ENTRIES]");
        self.inputs.iter().for_each(|name| parameters.push_str(&format!(", float {name}")));
        self.outputs.iter().for_each(|name| parameters.push_str(&format!(", float {name}")));
        let name_of = |input: usize| match input {
            input if input < means => format!("x[{input}]"),
            input if input < more => format!("p[{}]", input - means),
            input if input < more + MORE => self.inputs.get(input - more).copied().unwrap_or("0.0f").to_owned(),
            input => format!("s[{}]", steps.get(input - more - MORE).map_or("0", String::as_str)),
        };
        let state = (0..if self.changes_state { means + covariances } else { 0 }).map(name_of);
        let targets: Vec<String> = state.chain(self.outputs.iter().map(|name| (*name).to_owned())).collect();
        let mut body = Body::new(recorded, &name_of);
        let is_of_step = |(place, operation): (usize, &Operation)| {
            matches!(operation, Operation::Input(input) if *input >= more + MORE) && body.uses[place] > 0
        };
        if recorded.operations.iter().enumerate().any(is_of_step) {
            parameters.push_str(", const float s[STEP]");
        }
        let mut results = String::new();
        for (k, (target, place)) in targets.iter().zip(&recorded.results).enumerate() {
            // What stays as it is need not be written.
            if !(self.changes_state && recorded.operations[*place] == Operation::Input(k)) {
                let _ = writeln!(results, "    {target} = {};", body.value(*place));
            }
        }
        if let Some(place) = recorded.results.last().filter(|_| self.is_truth) {
            let _ = writeln!(results, "    return {};", body.value(*place));
        }
        let kind = if self.is_truth { "int" } else { "void" };
        format!("/* {} */\nstatic {kind} {}({parameters})\n{{\n{}{results}}}\n", self.comment, self.name, body.lines)
    }
}
