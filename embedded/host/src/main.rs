//! `vectors`: the codes that the firmware replays, and the strains that the filters compute from them in double precision.
//! `report`: the firmware's measurements, compared with these and with the budgets.

mod budgets;
mod codes;
mod image;
mod report;
mod run;
mod vectors;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done: Result<bool, Box<dyn Error>> = match words.as_slice() {
        ["vectors", root] => vectors::write(Path::new(root)).map(|()| true),
        ["vectors", root, "--check"] => vectors::check(Path::new(root)),
        ["report", root, images] => report::report(Path::new(root), Path::new(images)),
        ["report", root, images, "--update"] => report::update(Path::new(root), Path::new(images)),
        _ => Err("usage: vectors ROOT [--check] | report ROOT IMAGES [--update]".into()),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
