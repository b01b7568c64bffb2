//! A table as text, CSV or LaTeX.

use ohmstrain_calib::closed_form::Estimated;

use crate::args::TableFormat;
use crate::error::CliError;
use crate::output::{self, COLUMNS, print, print_data};
use ohmstrain::number::{plain, with_error};

/// A cell.
pub enum Cell {
    /// Words.
    Text(String),
    /// A number with its formatted text.
    Number(f64, String),
    /// A value with its standard error.
    Estimate(f64, f64),
    /// A value at the limit of the search.
    AtLimit(f64),
    /// A parameter that the readings do not determine.
    NotIdentified,
    /// No such parameter in this row.
    Nothing,
}

impl Cell {
    /// Returns the cell of a fitted parameter.
    pub fn of(estimated: Option<&Estimated>) -> Self {
        match estimated {
            None => Self::Nothing,
            Some(Estimated { value, standard_error: Some(error), .. }) => Self::Estimate(*value, *error),
            Some(Estimated { value, at_limit: true, .. }) => Self::AtLimit(*value),
            Some(_) => Self::NotIdentified,
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Text(text) | Self::Number(_, text) => text.clone(),
            Self::Estimate(value, error) => with_error(*value, *error),
            Self::AtLimit(value) => format!("{} (limit)", plain(*value)),
            Self::NotIdentified => "undetermined".into(),
            Self::Nothing => String::new(),
        }
    }

    /// Formats the value, and the standard error after it, with all digits.
    fn csv(&self, has_error: bool) -> impl Iterator<Item = String> {
        let (value, error) = match self {
            Self::Text(text) => (text.clone(), String::new()),
            Self::Estimate(value, error) => (value.to_string(), error.to_string()),
            Self::AtLimit(value) | Self::Number(value, _) => (value.to_string(), String::new()),
            Self::NotIdentified | Self::Nothing => (String::new(), String::new()),
        };
        std::iter::once(value).chain(has_error.then_some(error))
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// A table.
pub struct LawTable {
    /// Number of leading columns that identify a row.
    pub keys: usize,
    pub header: Vec<String>,
    pub rows: Vec<Vec<Cell>>,
}

impl LawTable {
    /// Prints it.
    pub fn print(&self, format: TableFormat) -> Result<(), CliError> {
        match format {
            TableFormat::Text => print(|out| Ok(out.write_all(self.text().as_bytes())?)),
            TableFormat::Csv => {
                let failed = |error| CliError::Other(format!("cannot write CSV: {error}"));
                print_data(&self.csv().map_err(failed)?)
            }
            TableFormat::Latex => print_data(self.latex().as_bytes()),
        }
    }

    fn text(&self) -> String {
        let rows: Vec<Vec<String>> = self.rows.iter().map(|row| row.iter().map(Cell::text).collect()).collect();
        let mut text = String::new();
        // Cells that all rows share stand above the table.
        let shared =
            rows.first().filter(|first| self.header[0] == "recording" && rows.iter().all(|row| row[0] == first[0]));
        if let Some(shared) = shared {
            text += &format!("{}:\n", shared[0]);
        }
        let keys: Vec<usize> = (usize::from(shared.is_some())..self.keys).collect();
        for columns in self.blocks(&rows, &keys) {
            let columns = || keys.iter().chain(&columns);
            let mut table = output::table(columns().map(|column| &self.header[*column]));
            for row in &rows {
                table.add_row(columns().map(|column| &row[*column]));
            }
            text += &format!("{table}\n");
        }
        text
    }

    /// Splits the columns after the keys into blocks; as many as fit a terminal beside the keys form one block.
    fn blocks(&self, rows: &[Vec<String>], keys: &[usize]) -> Vec<Vec<usize>> {
        let width = |column: &usize| {
            let cells = rows.iter().map(|row| &row[*column]).chain([&self.header[*column]]);
            3 + cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let room = COLUMNS.saturating_sub(1 + keys.iter().map(width).sum::<usize>());
        let (mut blocks, mut used): (Vec<Vec<usize>>, usize) = (vec![vec![]], 0);
        for column in self.keys..self.header.len() {
            let wide = width(&column);
            match blocks.last_mut() {
                Some(block) if block.is_empty() || used + wide <= room => {
                    block.push(column);
                    used += wide;
                }
                _ => {
                    blocks.push(vec![column]);
                    used = wide;
                }
            }
        }
        blocks
    }

    /// Formats the table as CSV, with a column of standard errors after each parameter.
    fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        let is_estimate = |row: &Vec<Cell>, column: usize| matches!(row.get(column), Some(Cell::Estimate(..)));
        let has_error = |column: usize| self.rows.iter().any(|row| is_estimate(row, column));
        let names = |(column, name): (usize, &String)| {
            let error = has_error(column).then(|| format!("standard error of {name}"));
            std::iter::once(name.clone()).chain(error)
        };
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record(self.header.iter().enumerate().flat_map(names))?;
        for row in &self.rows {
            out.write_record(row.iter().enumerate().flat_map(|(column, cell)| cell.csv(has_error(column))))?;
        }
        out.into_inner().map_err(|failed| failed.into_error().into())
    }

    /// Formats the table as a LaTeX `tabular` with the rules of the package booktabs.
    fn latex(&self) -> String {
        let line = |cells: Vec<String>| cells.join(" & ") + " \\\\\n";
        let mut text = format!(
            "% needs \\usepackage{{booktabs}}\n\\begin{{tabular}}{{{}}}\n\\toprule\n",
            "l".repeat(self.header.len())
        );
        text += &line(self.header.iter().map(|name| escaped(name)).collect());
        text += "\\midrule\n";
        for row in &self.rows {
            text += &line(row.iter().map(|cell| escaped(&cell.text())).collect());
        }
        text + "\\bottomrule\n\\end{tabular}\n"
    }
}

/// Superscripts and their replacements.
const POWERS: &str = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹";
const POWER_DIGITS: &str = "-0123456789";

/// Escapes the text of a cell for LaTeX.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    let mut in_power = false;
    for c in text.chars() {
        let power = POWERS.chars().position(|power| power == c).and_then(|at| POWER_DIGITS.chars().nth(at));
        if in_power && power.is_none() {
            out += "}$";
        }
        if let Some(digit) = power {
            out += if in_power { "" } else { "$^{" };
            out.push(digit);
            in_power = true;
            continue;
        }
        in_power = false;
        match c {
            '_' | '%' | '&' | '#' | '{' | '}' => out.extend(['\\', c]),
            '^' => out += "\\textasciicircum{}",
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '±' => out += "$\\pm$",
            '−' => out += "$-$",
            '·' => out += "$\\cdot$",
            '*' => out += "$\\cdot$",
            '∞' => out += "$\\infty$",
            'Δ' => out += "$\\Delta$",
            c => out.push(c),
        }
    }
    out + if in_power { "}$" } else { "" }
}

#[cfg(test)]
mod tests {
    use super::{Cell, LawTable};

    #[test]
    fn numbers_keep_their_digits_in_csv_and_their_signs_in_latex() {
        let header = ["segment", "tau_0, s"].map(String::from).to_vec();
        let rows = vec![
            vec![Cell::from("a, b".to_string()), Cell::Estimate(-1.23456789e-9, 1e-10)],
            vec![Cell::from("c_1".to_string()), Cell::NotIdentified],
            vec![Cell::from("d".to_string()), Cell::Number(-1.5e-7, "−1.5·10⁻⁷".into())],
        ];
        let table = LawTable { keys: 1, header, rows };
        let csv = String::from_utf8(table.csv().unwrap()).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines[0], "segment,\"tau_0, s\",\"standard error of tau_0, s\"");
        assert_eq!(lines[1..], ["\"a, b\",-0.00000000123456789,0.0000000001", "c_1,,", "d,-0.00000015,"]);
        let latex = table.latex();
        assert!(latex.contains("tau\\_0, s") && latex.contains("$-$1.235$\\cdot$10$^{-9}$ $\\pm$"), "{latex}");
    }
}
