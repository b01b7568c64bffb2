//! The table, and the verdict.

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::budgets::{Budgets, Figures};
use crate::image::Image;
use crate::run::Run;
use crate::vectors::{PROGRAMS, reference};

/// One program as it was measured: built for speed and for size.
struct Measured {
    name: &'static str,
    fast: (Run, Image),
    small: (Run, Image),
    /// Largest difference from the reference, of both builds.
    difference: f64,
}

/// Writes README.md; says on standard error what is over budget. Whether nothing is.
pub fn report(root: &Path, images: &Path) -> Result<bool, Box<dyn Error>> {
    let budgets = Budgets::read(&root.join("budgets.toml"))?;
    let csv = fs::read_to_string(root.join("vectors.csv"))?;
    let mut measured = Vec::new();
    let mut broken = Vec::new();
    for (name, expected) in PROGRAMS {
        let expected = reference(&csv, expected)?;
        let build = |profile: &str| -> Result<(Run, Image), Box<dyn Error>> {
            let stem = images.join(format!("{profile}-{name}"));
            Ok((Run::read(&stem.with_extension("out"))?, Image::read(&stem)?))
        };
        let (fast, small) = (build("release")?, build("small")?);
        for (run, image) in [&fast, &small] {
            broken.extend(forbidden(name, run, image));
        }
        let difference = fast.0.difference(&expected).max(small.0.difference(&expected));
        let program = Measured { name, fast, small, difference };
        broken.extend(budgets.broken(name, &program.figures()));
        measured.push(program);
    }
    let table = table(&measured, &budgets)?;
    print!("{table}");
    let introduction = fs::read_to_string(root.join("host/src/introduction.md"))?;
    fs::write(root.join("README.md"), introduction.replace("{table}\n", &table))?;
    for line in &broken {
        eprintln!("{line}");
    }
    Ok(broken.is_empty())
}

/// What no budget allows.
fn forbidden(name: &str, run: &Run, image: &Image) -> Vec<String> {
    let mut found = Vec::new();
    for symbol in &image.soft_double {
        found.push(format!("{name}: double precision in software: {symbol}"));
    }
    for symbol in &image.heap {
        found.push(format!("{name}: a heap: {symbol}"));
    }
    if image.indirect > 0 {
        found.push(format!("{name}: {} calls through pointers in a step", image.indirect));
    }
    if run.refused > 0 {
        found.push(format!("{name}: {} readings refused", run.refused));
    }
    found
}

impl Measured {
    /// The figures that have budgets. Time from the fast build, size from the small one, the rest from the worse.
    fn figures(&self) -> Figures {
        let ((fast, fast_image), (small, small_image)) = (&self.fast, &self.small);
        Figures::from([
            ("instructions", fast.instructions),
            ("dearest_instructions", f64::from(fast.dearest)),
            ("code_bytes", small_image.step_code as f64),
            ("read_only_bytes", fast_image.read_only.max(small_image.read_only) as f64),
            ("state_bytes", f64::from(fast.state)),
            ("stack_bytes", f64::from(fast.stack.max(small.stack))),
            ("panics", fast_image.panics.max(small_image.panics) as f64),
            ("strain_difference", self.difference),
        ])
    }
}

/// A figure, and what it should be.
fn beside(value: String, aim: Option<f64>) -> String {
    match aim {
        Some(aim) => format!("{value} ({aim})"),
        None => value,
    }
}

/// Instructions of a step with three states that were published for others, f32 on a Cortex-M4F.
const OTHERS: [(&str, f64); 3] = [("adskalman", 297.0), ("kfilter", 216.0), ("hand-written", 64.0)];

fn table(measured: &[Measured], budgets: &Budgets) -> Result<String, Box<dyn Error>> {
    let mut out = String::from(
        "| program | instructions a step, -O3 (aim) | dearest step | -Os | code of a step, B: -O3 | -Os (aim) | read-only, B \
         | state, B (aim) | stack, B: -O3 | -Os | calls of panics | largest difference of strain |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for program in measured {
        let ((fast, fast_image), (small, small_image)) = (&program.fast, &program.small);
        let aim = |figure| budgets.aim(program.name, figure);
        writeln!(
            out,
            "| `{}` | {} | {} | {:.0} | {} | {} | {} | {} | {} | {} | {} | {:.1e} |",
            program.name,
            beside(format!("{:.0}", fast.instructions), aim("instructions")),
            fast.dearest,
            small.instructions,
            fast_image.step_code,
            beside(small_image.step_code.to_string(), aim("code_bytes")),
            fast_image.read_only.max(small_image.read_only),
            beside(fast.state.to_string(), aim("state_bytes")),
            fast.stack,
            small.stack,
            fast_image.panics.max(small_image.panics),
            program.difference,
        )?;
    }
    if let Some(program) = measured.first() {
        writeln!(out, "\nConverting one code takes {:.0} instructions.\n", program.fast.0.conversion)?;
    }
    out.push_str("| three states | instructions a step |");
    for (name, _) in OTHERS {
        write!(out, " ÷ {name} |")?;
    }
    out.push_str("\n|---|--:|--:|--:|--:|\n");
    for program in measured.iter().filter(|program| program.name.contains('3')) {
        let instructions = program.fast.0.instructions;
        write!(out, "| `{}` | {instructions:.0} |", program.name)?;
        for (_, others) in OTHERS {
            write!(out, " {:.2} |", instructions / others)?;
        }
        out.push('\n');
    }
    Ok(out)
}
