//! Committed figures, and their tolerances.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Tolerated growth of a count with the compiler that the figures were measured with.
const ROOM: f64 = 1.05;
/// Tolerated growth of a count with any other compiler.
const ROOM_OTHER_COMPILER: f64 = 1.25;
/// Tolerated growth of an error of the strain: rounding in `f32` depends on the program, not on the compiler.
const ROOM_OF_ERRORS: f64 = 1.05;
/// Line between rules and aims, which people write, and the figures, which `--update` writes.
const FIGURES: &str = "# Measured; written by `run.sh --update`.\n";

/// Figures of one program by name.
pub type Figures = BTreeMap<&'static str, f64>;

/// The committed figures and aims of all programs, and the compiler of the figures.
pub struct Budgets {
    table: toml::Table,
    same_compiler: bool,
}

impl Budgets {
    /// Reads `budgets.toml` for programs built by `compiler`.
    pub fn read(path: &Path, compiler: &str) -> Result<Self, Box<dyn Error>> {
        Self::new(fs::read_to_string(path)?.parse()?, compiler)
    }

    fn new(table: toml::Table, compiler: &str) -> Result<Self, Box<dyn Error>> {
        let measured_with = table.get("measured").and_then(|measured| measured.get("compiler")?.as_str());
        let same_compiler = measured_with.ok_or("the figures do not name their compiler")? == compiler;
        Ok(Self { table, same_compiler })
    }

    /// True if the programs were built by the compiler of the figures.
    pub fn same_compiler(&self) -> bool {
        self.same_compiler
    }

    fn number(&self, table: &str, program: &str, figure: &str) -> Option<f64> {
        let value = self.table.get(table)?.get(program)?.get(figure)?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    }

    /// Returns the aim for a figure of a program.
    pub fn aim(&self, program: &str, figure: &str) -> Option<f64> {
        self.number("aim", program, figure)
    }

    /// Returns the factor by which a figure may exceed the committed one.
    fn room(&self, figure: &str) -> f64 {
        match figure {
            "state_bytes" => 1.0,
            "strain_difference" | "strain_rms_error" => ROOM_OF_ERRORS,
            // A budget without panics leaves no room.
            _ if self.same_compiler => ROOM,
            _ => ROOM_OTHER_COMPILER,
        }
    }

    /// Lists, in words, every figure above its budget or without one.
    pub fn broken(&self, program: &str, figures: &Figures) -> Vec<String> {
        let mut broken = Vec::new();
        for (figure, value) in figures {
            let room = self.room(figure);
            match self.number("measured", program, figure) {
                // Written so that NaN exceeds its limit.
                Some(budget) if *value <= budget * room => {}
                Some(budget) => broken.push(format!(
                    "{program}: {figure} is {value}, more than {:.0} % above its budget {budget}",
                    100.0 * (room - 1.0)
                )),
                None => broken.push(format!("{program}: {figure} is {value} and has no budget")),
            }
        }
        broken
    }

    /// Lists, in words, figures so far below their budgets that they should be committed.
    pub fn cheaper(&self, program: &str, figures: &Figures) -> Vec<String> {
        let budget = |figure| self.number("measured", program, figure).filter(|_| self.same_compiler);
        figures
            .iter()
            .filter_map(|(figure, value)| Some((figure, value, budget(figure)?)))
            .filter(|(_, value, budget)| **value < budget / ROOM)
            .map(|(figure, value, budget)| format!("{program}: {figure} fell from {budget} to {value}: run --update"))
            .collect()
    }
}

/// Writes the figures below rules and aims.
pub fn write(path: &Path, compiler: &str, programs: &[(&str, Figures)]) -> Result<(), Box<dyn Error>> {
    let old = fs::read_to_string(path)?;
    let (rule, _) = old.split_once(FIGURES).ok_or("budgets.toml has no line that says where figures begin")?;
    let mut text = format!("{rule}{FIGURES}[measured]\ncompiler = \"{compiler}\"\n");
    for (program, figures) in programs {
        writeln!(text, "\n[measured.{program}]")?;
        for (figure, value) in figures {
            if figure.starts_with("strain") {
                writeln!(text, "{figure} = {value:.2e}")?;
            } else {
                writeln!(text, "{figure} = {:.0}", value.ceil())?;
            }
        }
    }
    Ok(fs::write(path, text)?)
}

#[cfg(test)]
mod tests {
    use super::{Budgets, Figures};

    /// Returns how many of these figures are too large for a program built by `compiler`.
    fn broken(compiler: &str, figures: &[(&'static str, f64)]) -> usize {
        let budgets = "[measured]\ncompiler = \"ours\"\n[measured.ekf]\ninstructions = 1000\npanics = 0\n\
                       state_bytes = 36\nstrain_difference = 1e-6\n";
        let budgets = budgets.parse().map_err(Into::into).and_then(|table| Budgets::new(table, compiler));
        budgets.map(|budgets| budgets.broken("ekf", &Figures::from_iter(figures.iter().copied())).len()).unwrap_or(99)
    }

    #[test]
    fn counts_have_more_room_with_another_compiler() {
        assert_eq!(broken("ours", &[("instructions", 1049.0)]), 0);
        assert_eq!(broken("ours", &[("instructions", 1051.0)]), 1);
        assert_eq!(broken("another", &[("instructions", 1249.0)]), 0);
        assert_eq!(broken("another", &[("instructions", 1251.0)]), 1);
    }

    #[test]
    fn what_no_compiler_may_change_has_no_more_room() {
        for compiler in ["ours", "another"] {
            assert_eq!(broken(compiler, &[("panics", 1.0), ("state_bytes", 40.0), ("strain_difference", 1.1e-6)]), 3);
            assert_eq!(broken(compiler, &[("strain_difference", f64::NAN), ("code_bytes", 1.0)]), 2);
        }
    }
}
