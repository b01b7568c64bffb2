//! A function in C, recorded along all paths through it.

use std::fmt::Write;

use ohmstrain_ekf::record::{Function, Name, Operation, Writer, write_down};

use super::body::Body;
use super::listed::{Lists, Slot, list};

/// Name of a result that the function returns.
pub const RETURNED: &str = "return";
/// Prefix of results that are flags in the function's return value.
const FLAG: &str = "OHMSTRAIN_";

/// A function in C of the values kept from the readings.
pub struct Printed {
    pub name: &'static str,
    pub comment: &'static str,
    /// Parameters between the readings and what results are written to.
    pub parameters: &'static [&'static str],
    pub function: Function,
}

impl Printed {
    /// Records a function by running `done` with a writer.
    pub fn new(
        name: &'static str,
        comment: &'static str,
        parameters: &'static [&'static str],
        done: impl for<'t> Fn(&mut Writer<'t>),
    ) -> Self {
        Self { name, comment, parameters, function: write_down(done) }
    }

    pub fn text(&self) -> String {
        let Function { inputs, results, recorded } = &self.function;
        let name_of = |input: usize| inputs.get(input).map_or_else(String::new, in_c);
        let is_kept = |name: &Name, place: usize| match recorded.operations[place] {
            Operation::Input(input) | Operation::Flag(input) => inputs.get(input) == Some(name),
            _ => false,
        };
        let mut body = Body::new(recorded, &name_of);
        let (mut written, mut returned, mut flags, mut kind) = (String::new(), None, Vec::new(), "void");
        let (mut changes, mut outputs) = (false, Vec::new());
        for (name, place) in results.iter().zip(&recorded.results) {
            let is_truth = body.is_truth(*place);
            match name {
                Name::Field(_) if is_kept(name, *place) => {}
                Name::Field(_) => {
                    changes = true;
                    let target = in_c(name);
                    let value = body.value(*place);
                    let _ = writeln!(written, "    {target} = {value};");
                }
                Name::Own(own) if own == RETURNED => {
                    kind = if is_truth { "int" } else { "float" };
                    returned = Some(body.value(*place));
                }
                Name::Own(own) if own.starts_with(FLAG) => {
                    kind = "unsigned";
                    flags.push(format!("({} ? (unsigned){own} : 0u)", body.atom(*place)));
                }
                Name::Own(own) => {
                    outputs.push(format!("{} *{own}", if is_truth { "int" } else { "float" }));
                    let value = body.value(*place);
                    let _ = writeln!(written, "    *{own} = {value};");
                }
            }
        }
        if !flags.is_empty() {
            returned = Some(flags.join(" |\n           "));
        }
        let returns = returned.map_or_else(String::new, |value| format!("    return {value};\n"));
        let has_state = inputs.iter().any(|name| matches!(name, Name::Field(_))) || changes;
        let parameters = self.declared(has_state, changes, outputs);
        let body = format!("{}{written}{returns}", body.lines);
        defined(self.comment, &format!("{kind} {}", self.name), &parameters, &body)
    }
}

/// Combines a function as a list and the compiled one.
pub fn either(listed: &str, compiled: &str) -> String {
    let listed = listed.replacen("\nstatic ", "\nAPART static ", 1);
    format!("#if OHMSTRAIN_LISTED\n{listed}#else\n{compiled}#endif\n")
}

/// Fields that functions keep: numbers first, then truth values.
#[derive(Debug, Default)]
pub struct Kept {
    pub numbers: Vec<String>,
    pub truths: Vec<String>,
}

impl Printed {
    /// Returns the function as a list, if it is worth one, and compiled.
    pub fn either(&self, fields: &Kept, lists: &mut Lists) -> String {
        let compiled = self.text();
        self.listed(fields, lists).map_or_else(|| compiled.clone(), |listed| either(&listed, &compiled))
    }

    fn listed(&self, fields: &Kept, lists: &mut Lists) -> Option<String> {
        let Function { inputs, results, recorded } = &self.function;
        let field = |name: &str| {
            let number = fields.numbers.iter().position(|field| field == name).map(Slot::Number);
            number.or_else(|| fields.truths.iter().position(|field| field == name).map(Slot::Truth))
        };
        let mut given = 0;
        let mut slot = |name: &Name| match name {
            Name::Field(name) => field(name),
            Name::Own(_) => {
                given += 1;
                Some(Slot::Given(given - 1))
            }
        };
        let slots: Vec<Slot> = inputs.iter().map(&mut slot).collect::<Option<_>>()?;
        let ends: Vec<Slot> = results.iter().map(&mut slot).collect::<Option<_>>()?;
        let is_as_it_was = |name: &Name, place: usize| match recorded.operations[place] {
            Operation::Input(input) | Operation::Flag(input) => {
                matches!(name, Name::Field(_)) && inputs[input] == *name
            }
            _ => false,
        };
        let mut kept = Vec::new();
        for ((name, place), end) in results.iter().zip(&recorded.results).zip(&ends) {
            if !is_as_it_was(name, *place) {
                kept.push((*place, *end));
            }
        }
        let lists_of = list(lists, recorded, &|input| slots[input], &kept)?;
        let is_truth = |place: usize| Body::new(recorded, &|_| String::new()).is_truth(place);
        let kind = |truth: bool| if truth { "truth" } else { "number" };
        let mut body = format!("{lists_of}    cell given[{}];\n", given.max(1));
        for (number, (name, slot)) in inputs.iter().zip(&slots).enumerate() {
            if let (Name::Own(name), Slot::Given(at)) = (name, slot) {
                let truth = recorded.operations.contains(&Operation::Flag(number));
                let cast = if truth { "(unsigned char)" } else { "" };
                let _ = writeln!(body, "    given[{at}].{} = {cast}{name};", kind(truth));
            }
        }
        let changes = kept.iter().any(|(_, slot)| !matches!(slot, Slot::Given(_)));
        let has_state = changes || inputs.iter().any(|name| matches!(name, Name::Field(_)));
        let state = match (has_state, fields.numbers.first(), fields.truths.first()) {
            (true, Some(number), Some(truth)) => {
                format!("(float *)&seen->{number}, (unsigned char *)&seen->{truth}")
            }
            _ => "0, 0".to_owned(),
        };
        let _ = writeln!(body, "    run_list(OPERATIONS, CONSTANTS, {state}, 0, given);");
        let (mut outputs, mut flags, mut returned, mut of_kind) = (Vec::new(), Vec::new(), None, "void");
        for ((name, place), end) in results.iter().zip(&recorded.results).zip(&ends) {
            let (Slot::Given(at), truth) = (end, is_truth(*place)) else { continue };
            match name {
                Name::Field(_) => {}
                Name::Own(own) if own == RETURNED => {
                    of_kind = if truth { "int" } else { "float" };
                    returned = Some(format!("given[{at}].{}", kind(truth)));
                }
                Name::Own(own) if own.starts_with(FLAG) => {
                    of_kind = "unsigned";
                    flags.push(format!("(given[{at}].truth ? (unsigned){own} : 0u)"));
                }
                Name::Own(own) => {
                    outputs.push(format!("{} *{own}", if truth { "int" } else { "float" }));
                    let _ = writeln!(body, "    *{own} = given[{at}].{};", kind(truth));
                }
            }
        }
        if !flags.is_empty() {
            returned = Some(flags.join(" |\n           "));
        }
        if let Some(returned) = returned {
            let _ = writeln!(body, "    return {returned};");
        }
        let parameters = self.declared(has_state, changes, outputs);
        Some(defined(self.comment, &format!("{of_kind} {}", self.name), &parameters, &body))
    }

    /// Declares the parameters in C.
    fn declared(&self, has_state: bool, changes: bool, outputs: Vec<String>) -> Vec<String> {
        let seen = if changes { "readings *seen" } else { "const readings *seen" };
        let own = self.parameters.iter().map(|parameter| (*parameter).to_owned());
        has_state.then(|| seen.to_owned()).into_iter().chain(own).chain(outputs).collect()
    }
}

/// Returns a function of this kind and name. Unused parameters are marked: compilers warn of them.
pub fn defined(comment: &str, name: &str, parameters: &[String], body: &str) -> String {
    let is_of_names = |c: char| c.is_alphanumeric() || c == '_';
    let name_of = |parameter: &String| {
        let declared = parameter.split('[').next().unwrap_or_default();
        declared.rsplit(|c| !is_of_names(c)).next().unwrap_or_default().to_owned()
    };
    let is_unused = |name: &String| body.split(|c| !is_of_names(c)).all(|word| word != name);
    let unused: String =
        parameters.iter().map(name_of).filter(is_unused).map(|name| format!("    (void){name};\n")).collect();
    format!("/* {comment} */\nstatic {name}({})\n{{\n{unused}{body}}}\n", parameters.join(", "))
}

fn in_c(name: &Name) -> String {
    match name {
        Name::Field(field) => format!("seen->{field}"),
        Name::Own(own) => own.clone(),
    }
}
