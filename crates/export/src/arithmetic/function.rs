//! A function in C, recorded along all paths through it.

use std::fmt::Write;

use ohmstrain_ekf::record::{Function, Name, Operation, Place, Writer, write_down};

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
        let mut body = Body::new(recorded, &name_of);
        let (mut ends, mut changes) = (Ends::default(), false);
        for (name, place) in results.iter().zip(&recorded.results) {
            let is_truth = body.is_truth(*place);
            match name {
                Name::Field(_) if self.is_kept(name, *place) => {}
                Name::Field(_) => {
                    changes = true;
                    let (target, value) = (in_c(name), body.value(*place));
                    let _ = writeln!(ends.written, "    {target} = {value};");
                }
                Name::Own(own) if own.starts_with(FLAG) => ends.add(own, is_truth, &body.atom(*place)),
                Name::Own(own) => ends.add(own, is_truth, &body.value(*place)),
            }
        }
        let has_state = inputs.iter().any(|name| matches!(name, Name::Field(_))) || changes;
        let before = std::mem::take(&mut body.lines);
        self.defined(before, ends, has_state, changes)
    }

    /// True if a result is a field that remains as it is.
    fn is_kept(&self, name: &Name, place: Place) -> bool {
        let Function { inputs, recorded, .. } = &self.function;
        match recorded.operations[place] {
            Operation::Input(input) | Operation::Flag(input) => {
                matches!(name, Name::Field(_)) && inputs.get(input) == Some(name)
            }
            _ => false,
        }
    }

    /// Returns the function with this body, at the end of which it writes and returns its results.
    fn defined(&self, mut body: String, ends: Ends, has_state: bool, changes: bool) -> String {
        let Ends { outputs, written, flags, returned } = ends;
        let flags = (!flags.is_empty()).then(|| ("unsigned", flags.join(" |\n           ")));
        body.push_str(&written);
        let mut kind = "void";
        if let Some((of_value, value)) = flags.or(returned) {
            kind = of_value;
            let _ = writeln!(body, "    return {value};");
        }
        let seen = if changes { "readings *seen" } else { "const readings *seen" };
        let own = self.parameters.iter().map(|parameter| (*parameter).to_owned());
        let parameters: Vec<String> =
            has_state.then(|| seen.to_owned()).into_iter().chain(own).chain(outputs).collect();
        defined(self.comment, &format!("{kind} {}", self.name), &parameters, &body)
    }
}

/// Results of a function that are no fields.
#[derive(Default)]
struct Ends {
    /// Parameters that results are written to, and the lines that write results.
    outputs: Vec<String>,
    written: String,
    /// Flags of the function's value.
    flags: Vec<String>,
    /// Kind of its value, and the value.
    returned: Option<(&'static str, String)>,
}

impl Ends {
    fn add(&mut self, own: &str, is_truth: bool, value: &str) {
        let kind = if is_truth { "int" } else { "float" };
        if own == RETURNED {
            self.returned = Some((kind, value.to_owned()));
        } else if own.starts_with(FLAG) {
            self.flags.push(format!("({value} ? (unsigned){own} : 0u)"));
        } else {
            self.outputs.push(format!("{kind} *{own}"));
            let _ = writeln!(self.written, "    *{own} = {value};");
        }
    }
}

/// Combines a function as a list, if there is one, and the compiled one.
pub fn either(listed: Option<String>, compiled: String) -> String {
    let Some(listed) = listed else { return compiled };
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
        either(self.listed(fields, lists), self.text())
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
        let all = results.iter().zip(&recorded.results).zip(&ends);
        let changed = all.filter(|((name, place), _)| !self.is_kept(name, **place));
        let kept: Vec<_> = changed.map(|((_, place), end)| (*place, *end)).collect();
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
        let mut given = Ends::default();
        for ((name, place), end) in results.iter().zip(&recorded.results).zip(&ends) {
            if let (Name::Own(own), Slot::Given(at)) = (name, end) {
                let truth = is_truth(*place);
                given.add(own, truth, &format!("given[{at}].{}", kind(truth)));
            }
        }
        Some(self.defined(body, given, has_state, changes))
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
