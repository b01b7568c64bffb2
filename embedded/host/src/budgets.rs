//! Limits, and the figures that they are for.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// Figures of one program by name.
pub type Figures = BTreeMap<&'static str, f64>;

/// Limits and aims of all programs.
pub struct Budgets(toml::Table);

impl Budgets {
    /// Reads `budgets.toml`.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        Ok(Self(std::fs::read_to_string(path)?.parse()?))
    }

    fn number(&self, program: &str, table: &str, figure: &str) -> Option<f64> {
        let value = self.0.get(program)?.get(table)?.get(figure)?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    }

    /// What a program should reach one day.
    pub fn aim(&self, program: &str, figure: &str) -> Option<f64> {
        self.number(program, "aim", figure)
    }

    /// Every figure above its limit, or without one, in words.
    pub fn broken(&self, program: &str, figures: &Figures) -> Vec<String> {
        let mut broken = Vec::new();
        for (figure, value) in figures {
            match self.number(program, "limit", figure) {
                // Written so that a NaN breaks its limit.
                Some(limit) if *value <= limit => {}
                Some(limit) => broken.push(format!("{program}: {figure} is {value:.9}, the limit {limit}")),
                None => broken.push(format!("{program}: {figure} is {value:.9} and has no limit in budgets.toml")),
            }
        }
        broken
    }
}
