use std::path::PathBuf;

use clap::Args as ClapArgs;
use clap_complete::Shell;

/// Flags of `completions`.
#[derive(Debug, ClapArgs)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// Flags of `man`.
#[derive(Debug, ClapArgs)]
pub struct ManArgs {
    /// Folder to write one page per command to; files there of the same names are replaced
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use crate::args::{Args, example};

    /// What help shows is what the program takes.
    #[test]
    fn examples_are_commands() {
        for command in Args::command().get_subcommands() {
            let shown = example(command.get_name()).unwrap();
            let words = shown.strip_prefix("Example: ").unwrap().split(" > ").next().unwrap().split(' ');
            assert!(Args::try_parse_from(words).is_ok(), "{shown}");
        }
    }
}
