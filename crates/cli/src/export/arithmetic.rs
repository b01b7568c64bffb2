//! The kernel's arithmetic as functions in C, printed from what the kernel itself wrote down.

use std::fmt::Write;

use ohmstrain_ekf::record::{Carried, Operation, Piece, Place, Recorded};
use ohmstrain_model::Phase;

use super::literal::Literal;

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

/// The lines of a function; what is used once stands where it is used.
struct Body<'a> {
    operations: &'a [Operation],
    /// How often each result is used.
    uses: Vec<usize>,
    /// Its expression, once it has one, and how tightly that binds.
    values: Vec<Option<(String, Binds)>>,
    name_of: &'a dyn Fn(usize) -> String,
    lines: String,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binds {
    Choice,
    Truth,
    Less,
    Sum,
    Product,
    Atom,
}

/// Inputs between the state and the step.
const MORE: usize = 2;
/// Expressions do not grow beyond this.
const LONGEST: usize = 84;

impl<'a> Body<'a> {
    fn new(recorded: &'a Recorded, name_of: &'a dyn Fn(usize) -> String) -> Self {
        let operations = recorded.operations.as_slice();
        Self {
            operations,
            uses: uses_of_needed(operations, &recorded.results),
            values: vec![None; operations.len()],
            name_of,
            lines: String::new(),
        }
    }

    /// The expression of a result.
    fn value(&mut self, place: Place) -> String {
        self.bound(place, Binds::Choice)
    }

    /// The same, in brackets where it binds less tightly than what is around it.
    fn bound(&mut self, place: Place, least: Binds) -> String {
        if self.values[place].is_none() {
            let made = self.made(place);
            self.values[place] = Some(made);
        }
        match &self.values[place] {
            Some((text, binds)) if *binds >= least => text.clone(),
            Some((text, _)) => format!("({text})"),
            None => String::new(),
        }
    }

    fn made(&mut self, place: Place) -> (String, Binds) {
        let (text, binds) = self.expression(place);
        let operation = self.operations[place];
        let is_plain = matches!(operation, Operation::Constant(_) | Operation::Known(_));
        // What belongs to the state is overwritten in the end: it is read before.
        let is_state = matches!(operation, Operation::Input(_)) && !text.starts_with("s[");
        if is_plain || !is_state && self.uses[place] <= 1 && text.len() <= LONGEST {
            return (text, binds);
        }
        if let Operation::Input(number) = operation {
            let own = (self.name_of)(number);
            let inner = own.strip_prefix("s[").unwrap_or(&own);
            let name: String = inner.chars().filter(|c| c.is_alphanumeric() || *c == '_').collect();
            let name = name.to_lowercase();
            // A parameter has its name already.
            if name == own {
                return (name, Binds::Atom);
            }
            let _ = writeln!(self.lines, "    const float {name} = {own};");
            return (name, Binds::Atom);
        }
        let (kind, letter) = if is_truth(operation) { ("int", 'm') } else { ("float", 't') };
        let name = format!("{letter}{place}");
        let _ = writeln!(self.lines, "    const {kind} {name} = {text};");
        (name, Binds::Atom)
    }

    fn expression(&mut self, place: Place) -> (String, Binds) {
        use Binds::{Atom, Choice, Less, Product, Sum, Truth};
        let (text, binds) = match self.operations[place] {
            Operation::Input(number) => ((self.name_of)(number), Atom),
            Operation::Constant(number) => {
                (format!("{}f", Literal(number).text()), if number.is_sign_negative() { Product } else { Atom })
            }
            Operation::Known(truth) => (u8::from(truth).to_string(), Atom),
            Operation::Add(a, b) => (format!("{} + {}", self.bound(a, Sum), self.bound(b, Product)), Sum),
            Operation::Subtract(a, b) => (format!("{} - {}", self.bound(a, Sum), self.bound(b, Product)), Sum),
            Operation::Multiply(a, b) => (format!("{} * {}", self.bound(a, Product), self.bound(b, Atom)), Product),
            Operation::Divide(a, b) => (format!("{} / {}", self.bound(a, Product), self.bound(b, Atom)), Product),
            Operation::Negate(a) => (format!("-{}", self.bound(a, Atom)), Product),
            Operation::Root(a) => (format!("sqrtf({})", self.value(a)), Atom),
            Operation::Exponential(a) => (format!("expf({})", self.value(a)), Atom),
            Operation::Less(a, b) => (format!("{} < {}", self.bound(a, Sum), self.bound(b, Sum)), Less),
            Operation::NotNegative(a) => (format!("{} >= 0.0f", self.bound(a, Sum)), Less),
            Operation::Finite(a) => (format!("isfinite({})", self.value(a)), Atom),
            Operation::Both(a, b) => (format!("{} && {}", self.bound(a, Truth), self.bound(b, Less)), Truth),
            Operation::Pick(mask, yes, no) => {
                let [mask, yes, no] = [self.bound(mask, Truth), self.bound(yes, Truth), self.bound(no, Truth)];
                (format!("{mask} ? {yes} : {no}"), Choice)
            }
        };
        (text, binds)
    }
}

fn is_truth(operation: Operation) -> bool {
    matches!(
        operation,
        Operation::Less(..)
            | Operation::NotNegative(_)
            | Operation::Finite(_)
            | Operation::Both(..)
            | Operation::Known(_)
    )
}

/// How often each result is used by what leads to the results.
fn uses_of_needed(operations: &[Operation], results: &[Place]) -> Vec<usize> {
    let mut uses = vec![0; operations.len()];
    results.iter().for_each(|place| uses[*place] += 1);
    for place in (0..operations.len()).rev() {
        if uses[place] > 0 {
            operations[place].operands().for_each(|operand| uses[operand] += 1);
        }
    }
    uses
}
