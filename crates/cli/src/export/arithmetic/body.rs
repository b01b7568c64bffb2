//! What was recorded as lines of C.

use std::fmt::Write;

use ohmstrain_ekf::record::{Operation, Place, Recorded};

use crate::export::literal::Literal;

/// The lines of a function; what is used once stands where it is used.
pub struct Body<'a> {
    operations: &'a [Operation],
    /// How often each result is used.
    pub uses: Vec<usize>,
    /// Its expression, once it has one, and how tightly that binds.
    values: Vec<Option<(String, Binds)>>,
    name_of: &'a dyn Fn(usize) -> String,
    pub lines: String,
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

/// Expressions do not grow beyond this.
const LONGEST: usize = 84;

impl<'a> Body<'a> {
    /// Of what was recorded, its inputs named by `name_of`.
    pub fn new(recorded: &'a Recorded, name_of: &'a dyn Fn(usize) -> String) -> Self {
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
    pub fn value(&mut self, place: Place) -> String {
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
