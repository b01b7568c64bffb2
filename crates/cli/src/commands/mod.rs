//! One file per command.

mod batch;
mod calibrate;
mod closing;
mod demo;
mod evaluate;
mod explain;
mod export;
mod export_choice;
mod export_score;
mod filter;
mod fit_law;
mod fleet;
mod hand;
mod import;
mod inspect;
mod live;
mod plan;
mod refine;
mod reporting;
mod score_table;
mod scoring;
mod serial_check;
mod shell;
mod simulate;
mod smooth;
mod tested;

use crate::args::Command;
use crate::error::CliError;

/// Runs a command.
pub fn dispatch(command: &Command) -> Result<(), CliError> {
    match command {
        Command::Demo(args) => demo::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Import(args) => import::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Refine(args) => refine::run(args),
        Command::FitLaw(args) => fit_law::run(args),
        Command::Filter(args) => filter::run(args),
        Command::Hand(args) => hand::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Live(args) => live::run(args),
        Command::Smooth(args) => smooth::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::Batch(args) => batch::run(args),
        Command::Fleet(args) => fleet::run(args),
        Command::Export(args) => export::run(args),
        Command::SerialCheck(args) => serial_check::run(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
