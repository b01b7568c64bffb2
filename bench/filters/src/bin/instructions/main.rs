//! Instructions per step, counted by callgrind, and their limits. `../instructions.sh` runs it.
//!
//! ```text
//! instructions list                                 what can be counted
//! instructions run NAME                             steps a filter inside of `counted`, and prints the number of steps
//! instructions judge BUDGET COUNTS RUSTC            compares `COUNTS` (lines of name, instructions, steps)
//! instructions judge BUDGET COUNTS RUSTC --update   writes them into the budget instead
//! ```

mod budget;

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;

use budget::{Budget, Counts};
use ohmstrain_bench_filters::{Corrected, Filter, STEPS, Visitor, every_filter, readings, sensor, smoother};

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["list"] => each(&mut |name, _| println!("{name}")),
        ["run", wanted] => {
            let mut ran = false;
            each(&mut |name, work| {
                if name == wanted {
                    ran = true;
                    work();
                    println!("{STEPS}");
                }
            });
            if !ran {
                return Err(format!("nothing is called `{wanted}`").into());
            }
        }
        ["judge", budget, counts, rustc] => {
            let counts = Counts::read(Path::new(counts))?;
            let verdict = Budget::read(Path::new(budget))?.judge(&counts, rustc);
            print!("{}", verdict.table);
            for complaint in &verdict.broken {
                eprintln!("{complaint}");
            }
            return Ok(if verdict.broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
        }
        ["judge", budget, counts, rustc, "--update"] => {
            Budget::write(Path::new(budget), &Counts::read(Path::new(counts))?, rustc)?;
        }
        _ => return Err("expected list, run NAME or judge BUDGET COUNTS RUSTC [--update]".into()),
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the work; callgrind counts while this function is on the stack.
#[inline(never)]
fn counted<T>(work: impl FnOnce() -> T) -> T {
    work()
}

/// Passes every name that can be counted to `see`, with its work.
fn each(see: &mut dyn FnMut(&'static str, &mut dyn FnMut())) {
    every_filter(&mut Stepper(see));
    let recording = readings::<1>(STEPS);
    Stepper(see).visit("correction", &recording, Corrected::new());
    let smoother = smoother(sensor::<1, 3>());
    see("smoother_3", &mut || {
        black_box(counted(|| smoother.in_place(black_box(&recording))));
    });
}

struct Stepper<'a>(&'a mut dyn FnMut(&'static str, &mut dyn FnMut()));

impl Visitor for Stepper<'_> {
    fn visit(&mut self, name: &'static str, readings: &[f64], mut filter: impl Filter) {
        assert_eq!(readings.len(), STEPS);
        (self.0)(name, &mut || {
            let failed = counted(|| readings.iter().filter(|y| !black_box(&mut filter).step(black_box(**y))).count());
            assert_eq!(failed, 0, "{name}: steps failed");
        });
    }
}
