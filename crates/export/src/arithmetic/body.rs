//! Recorded operations as lines of C.

pub mod scopes;

use std::fmt::Write;

use ohmstrain_ekf::record::{Operation, Place, Recorded};

use crate::literal::Literal;
use scopes::Scopes;

/// Lines of a function. A result that is used once is printed where it is used; one that only one arm of a choice needs is
/// computed in that arm.
pub struct Body<'a> {
    operations: &'a [Operation],
    /// Number of uses of each result.
    pub uses: Vec<usize>,
    scopes: Scopes,
    /// Its expression, once it exists, and the operator precedence of that.
    values: Vec<Option<(String, Binds)>>,
    name_of: &'a dyn Fn(usize) -> String,
    pub lines: String,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binds {
    Choice,
    Either,
    Truth,
    Less,
    Sum,
    Product,
    Atom,
}

/// Longest expression, characters.
const LONGEST: usize = 84;

impl<'a> Body<'a> {
    /// Prepares the body of a recorded function; `name_of` names its inputs.
    pub fn new(recorded: &'a Recorded, name_of: &'a dyn Fn(usize) -> String) -> Self {
        let operations = recorded.operations.as_slice();
        let uses = uses_of_needed(operations, &recorded.results);
        Self {
            operations,
            scopes: Scopes::new(operations, &uses, &recorded.results),
            uses,
            values: vec![None; operations.len()],
            name_of,
            lines: String::new(),
        }
    }

    /// Returns the expression of a result.
    pub fn value(&mut self, place: Place) -> String {
        self.bound(place, Binds::Choice)
    }

    /// Returns the expression, in brackets unless it is a name.
    pub fn atom(&mut self, place: Place) -> String {
        self.bound(place, Binds::Atom)
    }

    /// Returns the expression, in brackets if it binds less tightly than its surroundings.
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
        if self.scopes.branch_of(place).is_some() {
            self.branch(place);
            return (format!("t{place}"), Binds::Atom);
        }
        if let Operation::Tail(border) = self.operations[place] {
            let border = self.value(border);
            let (name, hazard) = (format!("t{place}"), hazard(place));
            let _ =
                writeln!(self.lines, "    float {hazard};\n    const float {name} = tail_above({border}, &{hazard});");
            return (name, Binds::Atom);
        }
        let (text, binds) = self.expression(place);
        let operation = self.operations[place];
        let is_plain = matches!(operation, Operation::Constant(_) | Operation::Known(_));
        // Numbers of the state are overwritten at the end, so they are read before.
        let is_state = matches!(operation, Operation::Input(_) | Operation::Flag(_)) && !text.starts_with("s[");
        if is_plain || !is_state && self.uses[place] <= 1 && text.len() <= LONGEST {
            return (text, binds);
        }
        if let Operation::Input(number) | Operation::Flag(number) = operation {
            let own = (self.name_of)(number);
            let inner = ["s[", "seen->"].iter().find_map(|outer| own.strip_prefix(outer)).unwrap_or(&own);
            let name: String = inner.chars().filter(|c| c.is_alphanumeric() || *c == '_').collect();
            let name = name.to_lowercase();
            // A parameter has its name already.
            if name == own {
                return (name, Binds::Atom);
            }
            let kind = if self.is_truth(place) { "int" } else { "float" };
            let _ = writeln!(self.lines, "    const {kind} {name} = {own};");
            return (name, Binds::Atom);
        }
        let (kind, letter) = if self.is_truth(place) { ("int", 'm') } else { ("float", 't') };
        let name = format!("{letter}{place}");
        let _ = writeln!(self.lines, "    const {kind} {name} = {text};");
        (name, Binds::Atom)
    }

    /// Prints a choice whose arms are worth a branch, together with all choices made by the same branch.
    fn branch(&mut self, choice: Place) {
        let Some(branch) = self.scopes.branch_of(choice) else { return };
        let mut choices = branch.choices.clone();
        choices.sort_unstable();
        let shared = self.scopes.shared(self.operations, &self.uses, branch);
        let picks: Vec<_> = choices.iter().map(|place| (*place, self.operations[*place])).collect();
        let Operation::Pick(mask, ..) = self.operations[choice] else { return };
        let mask = self.value(mask);
        // Results that are used elsewhere, too, are computed before the branch.
        for place in shared {
            self.value(place);
        }
        for (place, _) in &picks {
            let kind = if self.is_truth(*place) { "int" } else { "float" };
            let _ = writeln!(self.lines, "    {kind} t{place};");
            self.values[*place] = Some((format!("t{place}"), Binds::Atom));
        }
        let _ = writeln!(self.lines, "    if ({mask}) {{");
        for way in 0..2 {
            let outer = std::mem::take(&mut self.lines);
            let mut set = String::new();
            for (place, pick) in &picks {
                let Operation::Pick(_, yes, no) = pick else { continue };
                let value = self.value([*yes, *no][way]);
                let _ = writeln!(set, "        t{place} = {value};");
            }
            let inner = std::mem::replace(&mut self.lines, outer);
            self.lines.push_str(if way == 0 { "" } else { "    } else {\n" });
            for line in inner.lines() {
                let _ = writeln!(self.lines, "    {line}");
            }
            self.lines.push_str(&set);
        }
        self.lines.push_str("    }\n");
    }

    /// True if a result is a truth value, not a number.
    pub fn is_truth(&self, place: Place) -> bool {
        match self.operations[place] {
            Operation::Pick(_, yes, _) => self.is_truth(yes),
            operation => operation.is_truth(),
        }
    }

    fn expression(&mut self, place: Place) -> (String, Binds) {
        use Binds::{Atom, Choice, Either, Less, Product, Sum, Truth};
        let (text, binds) = match self.operations[place] {
            Operation::Input(number) | Operation::Flag(number) => ((self.name_of)(number), Atom),
            Operation::Constant(number) if number == f32::INFINITY => ("INFINITY".into(), Atom),
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
            Operation::Absolute(a) => (format!("fabsf({})", self.value(a)), Atom),
            Operation::ExponentialLessOne(a) => (format!("expm1f({})", self.value(a)), Atom),
            Operation::Tangent(a) => (format!("tanhf({})", self.value(a)), Atom),
            Operation::Exponential(a) => (format!("expf({})", self.value(a)), Atom),
            Operation::Falling(a) => (format!("falling({})", self.value(a)), Atom),
            Operation::ToExponent(a) => (format!("to_exponent({})", self.value(a)), Atom),
            Operation::Tail(a) => (self.value(a), Atom),
            Operation::Hazard(tail) => {
                self.value(tail);
                (hazard(tail), Atom)
            }
            Operation::Less(a, b) => (format!("{} < {}", self.bound(a, Sum), self.bound(b, Sum)), Less),
            Operation::AtMost(a, b) => (format!("{} <= {}", self.bound(a, Sum), self.bound(b, Sum)), Less),
            Operation::Equal(a, b) => (format!("{} == {}", self.bound(a, Sum), self.bound(b, Sum)), Less),
            Operation::NotNegative(a) => (format!("{} >= 0.0f", self.bound(a, Sum)), Less),
            Operation::Finite(a) => (format!("isfinite({})", self.value(a)), Atom),
            Operation::Both(a, b) => (format!("{} && {}", self.bound(a, Truth), self.bound(b, Less)), Truth),
            // Compilers warn of `&&` within `||` without brackets.
            Operation::Either(a, b) => (format!("{} || {}", self.bound(a, Less), self.bound(b, Less)), Either),
            Operation::Not(a) => (format!("!{}", self.bound(a, Atom)), Product),
            Operation::Pick(mask, yes, no) => {
                let [mask, yes, no] = [self.bound(mask, Either), self.bound(yes, Either), self.bound(no, Either)];
                (format!("{mask} ? {yes} : {no}"), Choice)
            }
        };
        (text, binds)
    }
}

/// Place that the hazard of a tail is written to.
fn hazard(tail: Place) -> String {
    format!("hazard{tail}")
}

/// Counts the uses of each result on the way to the results.
pub fn uses_of_needed(operations: &[Operation], results: &[Place]) -> Vec<usize> {
    let mut uses = vec![0; operations.len()];
    results.iter().for_each(|place| uses[*place] += 1);
    for place in (0..operations.len()).rev() {
        if uses[place] > 0 {
            operations[place].operands().for_each(|operand| uses[operand] += 1);
        }
    }
    uses
}
