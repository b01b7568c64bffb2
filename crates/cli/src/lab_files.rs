use std::io::Read;
use std::path::{Path, PathBuf};

use ohmstrain_bench_data::import::{ImportError, Plan, Recipe, Table, read_table};

use crate::error::{CliError, shell_word};
use crate::output::{HEAD, Kind, is_of_a_hand};
use crate::sensor_file;
use crate::whole_file;
use crate::whole_file::is_stdin;

/// Refuses results of this program, which look like tables, too.
pub fn refuse_results(path: &Path) -> Result<(), CliError> {
    let Some(head) = std::fs::File::open(path).ok().filter(|_| path.is_file()).and_then(head) else { return Ok(()) };
    let header = head.lines().next().unwrap_or_default();
    let what = if let Some(what) = sensor_file::other_kind(&head) {
        what
    } else if sensor_file::is_hand(&head) {
        sensor_file::A_HAND
    } else if sensor_file::is_one(head.as_bytes()) {
        "is a sensor file: give it to --sensor of `filter`, `smooth`, `evaluate` or `live`"
    } else if Kind::Estimates.wrote(&head, &[]) || is_of_a_hand(header) {
        "has estimates, what `filter` or `smooth` made of a recording: give the recording itself"
    } else {
        return Ok(());
    };
    Err(CliError::Input(format!("{} {what}", path.display())))
}

/// Returns the first bytes of a file as text.
fn head(file: std::fs::File) -> Option<String> {
    let mut bytes = Vec::new();
    file.take(HEAD).read_to_end(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// Reads a lab's files.
pub fn read(paths: &[PathBuf], recipe: &Recipe) -> Result<Vec<Table>, CliError> {
    if paths.iter().filter(|path| is_stdin(path)).count() > 1 {
        return Err(CliError::Arguments("FILE: - may stand there once".into()));
    }
    let table = |(index, path): (usize, &PathBuf)| {
        let name = if is_stdin(path) { "stdin".to_owned() } else { path.display().to_string() };
        Ok(read_table(whole_file::bytes(path)?, &name, &recipe.read_options(index))?)
    };
    paths.iter().enumerate().map(table).collect()
}

/// Returns the command that imports files as planned, quoted for a shell.
pub fn command(paths: &[PathBuf], tables: &[Table], plan: &Plan) -> String {
    command_of(paths, &plan.recipe(tables), &[])
}

/// Returns the command that imports files by a recipe, with further flags.
pub fn command_of(paths: &[PathBuf], recipe: &Recipe, flags: &[&str]) -> String {
    let mut words = vec!["ohmstrain".to_owned(), "import".to_owned()];
    for path in paths {
        let path = path.display().to_string();
        // A path that begins with a hyphen would be taken for a flag.
        words.push(if path.starts_with('-') && path != "-" { format!("./{path}") } else { path });
    }
    words.extend(recipe.arguments());
    words.extend(flags.iter().map(|flag| (*flag).to_owned()));
    let is_taken = |name: &str| paths.iter().any(|path| path.file_name().is_some_and(|file| file == name));
    let output = ["trace.csv", "imported.csv", "imported-trace.csv"].into_iter().find(|name| !is_taken(name));
    words.extend(["-o".to_owned(), output.unwrap_or("imported-trace-1.csv").to_owned()]);
    words.iter().map(|word| shell_word(word)).collect::<Vec<_>>().join(" ")
}

impl From<ImportError> for CliError {
    fn from(error: ImportError) -> Self {
        Self::Input(error.to_string())
    }
}
