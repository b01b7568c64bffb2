//! A function that was written down for all its ways, in C.

use std::fmt::Write;

use ohmstrain_ekf::record::{Function, Name, Operation, Writer, write_down};

use super::body::Body;

/// Name of a result that the function returns.
pub const RETURNED: &str = "return";
/// How results begin that are flags of what the function returns.
const FLAG: &str = "OHMSTRAIN_";

/// A function in C, of what is kept of the readings.
pub struct Printed {
    pub name: &'static str,
    pub comment: &'static str,
    /// Parameters between the readings and what results are written to.
    pub parameters: &'static [&'static str],
    pub function: Function,
}

impl Printed {
    /// Of what is done with a writer.
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
        let seen = if changes { "readings *seen" } else { "const readings *seen" };
        let parameters: Vec<String> = has_state
            .then(|| seen.to_owned())
            .into_iter()
            .chain(self.parameters.iter().map(|parameter| (*parameter).to_owned()))
            .chain(outputs)
            .collect();
        let body = format!("{}{written}{returns}", body.lines);
        defined(self.comment, &format!("{kind} {}", self.name), &parameters, &body)
    }
}

/// A function of this kind and name. What it does not use of its parameters is said: compilers warn of it.
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
