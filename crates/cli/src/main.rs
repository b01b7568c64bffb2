//! `ohmstrain`: from the resistance of a soft strain sensor to strain, with an honest error bar.
//!
//! stdout is data, stderr is messages. Exit codes: 0 done (a closed pipe too), 1 anything else, 2 arguments, 3
//! `evaluate --check` failed, 4 the contents of an input, 5 `batch`
//! could not do some recordings.

mod alignment;
mod args;
mod channels;
mod chart;
mod commands;
mod error;
mod estimates;
mod filter_state;
mod input;
mod lab_files;
mod marks;
mod messages;
mod output;
mod parquet_table;
mod port;
mod printable;
mod progress;
mod protocol_file;
mod readings;
mod renamed;
mod run;
mod screen;
mod sensor_file;
mod stream;
mod suits;
mod whole_file;

use std::borrow::Cow;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use messages::Messages;
use printable::{printable, printable_lines};

fn main() -> ExitCode {
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(error) => return refused(error),
    };
    match commands::dispatch(&args.command, &Messages::shown(args.verbosity())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}

/// Reports an error in the arguments, with the command's example if an argument is missing; or prints help.
fn refused(mut error: clap::Error) -> ExitCode {
    let mut words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let command = words.find(|word| !word.starts_with('-'));
    if let Some(answer) = command.and_then(|command| renamed::answer(&error, &command)) {
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![answer.into()]));
    }
    let is_plain = std::env::args_os().all(|arg| matches!(printable(&arg.to_string_lossy()), Cow::Borrowed(_)));
    // In colours, unless an argument that the message quotes contains escape sequences.
    let _ = if is_plain || !error.use_stderr() {
        error.print()
    } else {
        write!(io::stderr(), "{}", printable_lines(&error.to_string()))
    };
    if error.kind() == ErrorKind::MissingRequiredArgument
        && let Some(example) = std::env::args().nth(1).and_then(|command| args::example(&command))
    {
        let _ = writeln!(io::stderr(), "\n{example}");
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}
