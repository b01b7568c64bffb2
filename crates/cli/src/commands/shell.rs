use std::path::Path;

use clap::{Command, CommandFactory};
use clap_mangen::Man;

use crate::args::{Args, CompletionsArgs, ManArgs};
use crate::error::CliError;
use crate::output::{Kind, MANUAL, Outputs, print_data};
use ohmstrain::MADE_BY;

/// Prints a shell's completions.
pub fn completions(args: &CompletionsArgs) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "ohmstrain", &mut script);
    print_data(&script)
}

/// Writes one manual page per command.
pub fn man(args: &ManArgs) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.replace.force, []);
    outputs.folder(&args.output)?;
    let mut all = Args::command().disable_help_subcommand(true);
    all.build();
    put_pages(&all, &args.output, &mut outputs)?;
    outputs.publish()
}

/// Writes the pages of a command and of its subcommands.
fn put_pages(command: &Command, folder: &Path, outputs: &mut Outputs) -> Result<(), CliError> {
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        put_pages(below, folder, outputs)?;
    }
    let page = Man::new(command.clone());
    let mut text = format!("{MANUAL}{MADE_BY}\n").into_bytes();
    page.render(&mut text)?;
    let claim = outputs.claim(&folder.join(page.get_filename()), Kind::Manual)?;
    outputs.put(claim, text);
    Ok(())
}
