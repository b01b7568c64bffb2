use std::fs;

use clap::CommandFactory;

use crate::args::{Args, CompletionsArgs, ManArgs};
use crate::error::CliError;
use crate::output::print;

/// Prints a shell's completions.
pub fn completions(args: &CompletionsArgs) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "ohmstrain", &mut script);
    print(|out| Ok(out.write_all(&script)?))
}

/// Writes one manual page per command.
pub fn man(args: &ManArgs) -> Result<(), CliError> {
    let folder = &args.output;
    fs::create_dir_all(folder).map_err(|error| CliError::file("make the folder", folder, &error))?;
    clap_mangen::generate_to(Args::command(), folder).map_err(|error| CliError::file("write to", folder, &error))
}
