//! Writes `../README.md` from the measurements by criterion, the memory program and callgrind. `../run.sh` runs it.
//!
//! ```text
//! report README MODE TARGET_DIR…     one directory per build, named after the processor it was built for
//! ```

mod figures;
mod machine;
mod table;

use std::error::Error;
use std::path::Path;

use figures::Build;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [readme, mode, directories @ ..] = &arguments[..] else {
        return Err("expected README MODE TARGET_DIR…".into());
    };
    let builds =
        directories.iter().map(|directory| Build::read(Path::new(directory))).collect::<Result<Vec<_>, _>>()?;
    let instructions = std::fs::read_to_string(Path::new(readme).with_file_name("instructions.toml"))?;
    let text = include_str!("introduction.md")
        .replace("{machine}", &machine::describe(mode)?)
        .replace("{targets}", &table::targets(&builds))
        .replace("{instructions}", &table::instructions(&instructions).ok_or("no figure of the sign-split filter")?)
        .replace("{beside}", &table::beside_constants(&builds))
        .replace("{steps}", &table::steps(&builds))
        .replace("{recordings}", &table::recordings(&builds))
        .replace("{memory}", &table::memory(&builds));
    Ok(std::fs::write(readme, text)?)
}
