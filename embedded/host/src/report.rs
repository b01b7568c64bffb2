//! The table, and the verdict.

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::budgets::{self, Budgets, Figures};
use crate::image::Image;
use crate::run::Run;
use crate::vectors::{PROGRAMS, TRUTH, column};

/// Measurements of one program, built for speed and for size.
struct Measured {
    name: &'static str,
    fast: (Run, Image),
    small: (Run, Image),
    /// Largest difference from the reference in both builds.
    difference: f64,
    /// Root mean square error of the strain in the worse build.
    rms_error: f64,
}

/// Prints the table; reports on standard error what is over budget, and, with the same compiler, whether README.md is out of
/// date. Returns true if all is well.
pub fn report(root: &Path, images: &Path) -> Result<bool, Box<dyn Error>> {
    let budgets = Budgets::read(&root.join("budgets.toml"), &compiler(images)?)?;
    let (measured, mut broken) = measure(root, images)?;
    for program in &measured {
        broken.extend(budgets.broken(program.name, &program.figures()));
    }
    let table = table(&measured, &budgets)?;
    print!("{table}");
    for line in measured.iter().flat_map(|program| budgets.cheaper(program.name, &program.figures())) {
        println!("{line}");
    }
    if !budgets.same_compiler() {
        println!("budgets.toml is of another compiler than {}: counts have room for 25 %", compiler(images)?);
    } else if fs::read_to_string(root.join("README.md"))? != readme(root, &table)? {
        broken.push("README.md is out of date: run `run.sh --update` and look at the difference".into());
    }
    for line in &broken {
        eprintln!("{line}");
    }
    Ok(broken.is_empty())
}

/// Writes README.md and the figures of budgets.toml. Returns true if nothing forbidden was found.
pub fn update(root: &Path, images: &Path) -> Result<bool, Box<dyn Error>> {
    let (measured, broken) = measure(root, images)?;
    let (path, compiler) = (root.join("budgets.toml"), compiler(images)?);
    let figures: Vec<_> = measured.iter().map(|program| (program.name, program.figures())).collect();
    budgets::write(&path, &compiler, &figures)?;
    let table = table(&measured, &Budgets::read(&path, &compiler)?)?;
    print!("{table}");
    fs::write(root.join("README.md"), readme(root, &table)?)?;
    for line in &broken {
        eprintln!("{line}");
    }
    Ok(broken.is_empty())
}

/// Returns the compiler's name as found in the programs that it built.
fn compiler(images: &Path) -> Result<String, Box<dyn Error>> {
    Ok(fs::read_to_string(images.join("compiler"))?.trim().to_owned())
}

fn readme(root: &Path, table: &str) -> Result<String, Box<dyn Error>> {
    Ok(fs::read_to_string(root.join("host/src/introduction.md"))?.replace("{table}\n", table))
}

/// Measures every program, and lists in words everything that is forbidden.
fn measure(root: &Path, images: &Path) -> Result<(Vec<Measured>, Vec<String>), Box<dyn Error>> {
    let csv = fs::read_to_string(root.join("vectors.csv"))?;
    let truth = column(&csv, TRUTH)?;
    let (mut measured, mut found) = (Vec::new(), Vec::new());
    for (name, expected) in PROGRAMS {
        let expected = column(&csv, expected)?;
        let build = |profile: &str| -> Result<(Run, Image), Box<dyn Error>> {
            let stem = images.join(format!("{profile}-{name}"));
            Ok((Run::read(&stem.with_extension("out"))?, Image::read(&stem)?))
        };
        let (fast, small) = (build("release")?, build("small")?);
        for (run, image) in [&fast, &small] {
            found.extend(forbidden(name, run, image));
        }
        let difference = larger(fast.0.difference(&expected), small.0.difference(&expected));
        let rms_error = larger(fast.0.rms_error(&truth), small.0.rms_error(&truth));
        measured.push(Measured { name, fast, small, difference, rms_error });
    }
    Ok((measured, found))
}

/// Returns the larger of two numbers; NaN if either is NaN, which `max` would hide.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Lists everything that no budget can permit.
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
    /// Returns the figures with budgets: times from the fast build, sizes from the small one, the rest from the worse.
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
            ("strain_rms_error", self.rms_error),
        ])
    }
}

/// Formats a figure with its aim.
fn beside(value: String, aim: Option<f64>) -> String {
    match aim {
        Some(aim) => format!("{value} ({aim})"),
        None => value,
    }
}

/// Published instructions of a step with three states for other filters, f32 on a Cortex-M4F.
const OTHERS: [(&str, f64); 3] = [("adskalman", 297.0), ("kfilter", 216.0), ("hand-written", 64.0)];

fn table(measured: &[Measured], budgets: &Budgets) -> Result<String, Box<dyn Error>> {
    let mut out = String::from(
        "| program | instructions a step, -O3 (aim) | dearest step | -Os | code of a step, B: -O3 | -Os (aim) | read-only, B \
         | state, B (aim) | stack, B: -O3 | -Os | calls of panics | largest difference of strain \
         | RMS error of strain |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for program in measured {
        let ((fast, fast_image), (small, small_image)) = (&program.fast, &program.small);
        let aim = |figure| budgets.aim(program.name, figure);
        writeln!(
            out,
            "| `{}` | {} | {} | {:.0} | {} | {} | {} | {} | {} | {} | {} | {:.1e} | {:.4} |",
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
            program.rms_error,
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
