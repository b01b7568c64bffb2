use std::path::PathBuf;

use clap::Args as ClapArgs;
use clap_complete::Shell;

use super::ReplaceArgs;

/// Flags of `completions`.
#[derive(Debug, ClapArgs)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// Flags of `man`.
#[derive(Debug, ClapArgs)]
pub struct ManArgs {
    /// Folder to write one page per command to; pages there of the same names are replaced
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory, Parser};

    use crate::args::{Args, example};

    /// Tests that the program accepts the examples that help shows.
    #[test]
    fn examples_are_commands() {
        for command in Args::command().get_subcommands() {
            let shown = example(command.get_name()).unwrap();
            let words = shown.strip_prefix("Example: ").unwrap().split(" > ").next().unwrap().split(' ');
            assert!(Args::try_parse_from(words).is_ok(), "{shown}");
        }
    }

    /// Names of types are of the source code.
    #[test]
    fn help_names_no_type() {
        fn check(command: &mut Command) {
            let help = [command.render_help(), command.render_long_help()].map(|help| help.to_string()).concat();
            let is_type = |word: &&str| {
                let letters: Vec<char> = word.chars().collect();
                let is_second = |at: &[char]| at[0].is_lowercase() && at[1].is_uppercase() && at[2].is_lowercase();
                letters.first().is_some_and(|first| first.is_uppercase()) && letters.windows(3).any(is_second)
            };
            let words = help.split(|c: char| !c.is_alphanumeric()).filter(|word| *word != "NumPy");
            let types: Vec<&str> = words.filter(is_type).collect();
            assert!(types.is_empty(), "{}: {types:?}", command.get_name());
            command.get_subcommands_mut().for_each(check);
        }
        let mut all = Args::command();
        all.build();
        check(&mut all);
    }
}
