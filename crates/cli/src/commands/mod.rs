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
mod record;
mod refine;
mod reporting;
mod score_table;
mod serial_check;
mod serve;
mod shell;
mod simulate;
mod smooth;

use crate::args::Command;
use crate::channels::Table;
use crate::error::CliError;
use crate::messages::Messages;
use crate::sensor_file;

/// Runs a command.
pub fn dispatch(command: &Command, messages: &Messages) -> Result<(), CliError> {
    match command {
        Command::Demo(args) => demo::run(args, messages),
        Command::Example(args) => simulate::example(args),
        Command::Serve(args) => serve::run(args, messages),
        Command::Inspect(args) => inspect::run(args),
        Command::Import(args) => import::run(args, messages),
        Command::Simulate(args) => simulate::run(args),
        Command::Calibrate(args) => {
            match args.traces.iter().map(|path| Table::read(path)).collect::<Result<Option<Vec<Table>>, _>>()? {
                Some(tables) => hand::calibrate::run(args, &tables, messages),
                None => calibrate::run(args, messages),
            }
        }
        Command::Record(args) => record::run(args, messages),
        Command::Refine(args) => refine::run(args, messages),
        Command::FitLaw(args) => fit_law::run(args, messages),
        Command::Filter(args) => filter::run(args, messages).map(drop),
        Command::Hand(args) => hand::run(args, messages).map(drop),
        Command::Plan(args) => plan::run(args, messages),
        Command::Live(args) => live::run(args, messages),
        Command::Smooth(args) => smooth::run(args, messages).map(drop),
        Command::Evaluate(args) => evaluate::run(args, messages),
        Command::Batch(args) => batch::run(args, messages),
        Command::Fleet(args) => fleet::run(args, messages),
        Command::Export(args) if sensor_file::is_of_a_hand(&args.sensor) => hand::export::run(args, &args.sensor),
        Command::Export(args) => export::run(args),
        Command::SerialCheck(args) => serial_check::run(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
