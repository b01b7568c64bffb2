//! `ohmstrain`: from the resistance of a soft strain sensor to strain, with an honest error bar.
//!
//! stdout is data, stderr is messages. Exit codes: 0 done (a closed pipe too), 1 anything else, 2 arguments, 3
//! `evaluate --check` failed, 4 the contents of an input.

mod alignment;
mod args;
mod commands;
mod error;
mod estimates;
mod export;
mod input;
mod lab_files;
mod output;
mod plausible;
mod progress;
mod readings;
mod report;
mod run;
mod sensor_file;
mod suits;
mod verdict;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match commands::dispatch(&args::Args::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}
