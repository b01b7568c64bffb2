//! Limits of instructions per step.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

/// Tolerated growth with the compiler that the budget was measured with.
const ROOM: f64 = 1.05;
/// Tolerated growth with any other compiler.
const ROOM_OTHER_COMPILER: f64 = 1.25;
/// Line between the rules, which people write, and the figures, which `--update` writes.
const FIGURES: &str = "# Measured; written by `instructions.sh --update`.\n";

/// Instructions per step by name.
pub struct Counts(BTreeMap<String, f64>);

impl Counts {
    /// Reads lines of name, instructions and steps.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let mut counts = BTreeMap::new();
        for line in std::fs::read_to_string(path)?.lines() {
            let mut words = line.split_whitespace();
            let (Some(name), Some(instructions), Some(steps)) = (words.next(), words.next(), words.next()) else {
                return Err(format!("expected name, instructions and steps, found `{line}`").into());
            };
            counts.insert(name.to_owned(), instructions.parse::<f64>()? / steps.parse::<f64>()?);
        }
        Ok(Self(counts))
    }
}

/// The committed figures, and the compiler that they were measured with.
pub struct Budget {
    rustc: String,
    per_step: BTreeMap<String, f64>,
}

/// Result of a comparison.
pub struct Verdict {
    /// Table of every figure beside its budget.
    pub table: String,
    /// Figures that exceed their limit, in words.
    pub broken: Vec<String>,
}

impl Budget {
    /// Reads a budget.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let table: toml::Table = std::fs::read_to_string(path)?.parse()?;
        let rustc = table.get("rustc").and_then(toml::Value::as_str).ok_or("the budget does not name its rustc")?;
        let figures = table.get("per_step").and_then(toml::Value::as_table).ok_or("the budget has no [per_step]")?;
        let number = |value: &toml::Value| value.as_integer().map(|whole| whole as f64).or_else(|| value.as_float());
        let per_step = figures.iter().filter_map(|(name, value)| Some((name.clone(), number(value)?))).collect();
        Ok(Self { rustc: rustc.to_owned(), per_step })
    }

    /// Writes figures below the rule.
    pub fn write(path: &Path, counts: &Counts, rustc: &str) -> Result<(), Box<dyn Error>> {
        let old = std::fs::read_to_string(path)?;
        let (rule, _) = old.split_once(FIGURES).ok_or("the budget has no line that says where figures begin")?;
        let mut text = format!("{rule}{FIGURES}rustc = \"{rustc}\"\n\n[per_step]\n");
        for (name, count) in &counts.0 {
            writeln!(text, "{name} = {}", count.ceil())?;
        }
        Ok(std::fs::write(path, text)?)
    }

    /// Compares counts with the budget.
    pub fn judge(&self, counts: &Counts, rustc: &str) -> Verdict {
        let same = self.rustc == rustc;
        let room = if same { ROOM } else { ROOM_OTHER_COMPILER };
        let mut verdict = Verdict { table: String::new(), broken: Vec::new() };
        if !same {
            verdict.table += &format!("measured with rustc {rustc}, the budget with {}: room for 25 %\n", self.rustc);
        }
        for (name, count) in &counts.0 {
            let Some(budget) = self.per_step.get(name) else {
                verdict.broken.push(format!("{name}: {count:.0} instructions per step and no budget"));
                continue;
            };
            let change = 100.0 * (count / budget - 1.0);
            let hint = if same && *count < budget / ROOM { "  cheaper: lower the budget with --update" } else { "" };
            verdict.table += &format!("{name:<24} {count:>8.0} of {budget:>6} {change:>+6.1} %{hint}\n");
            // Written so that NaN exceeds its limit.
            let within = *count <= budget * room;
            if !within {
                let allowed = 100.0 * (room - 1.0);
                verdict.broken.push(format!(
                    "{name}: {count:.0} instructions per step, budget {budget}: more than {allowed:.0} % above"
                ));
            }
        }
        for name in self.per_step.keys().filter(|name| !counts.0.contains_key(*name)) {
            verdict.broken.push(format!("{name}: has a budget and was not counted"));
        }
        verdict
    }
}
