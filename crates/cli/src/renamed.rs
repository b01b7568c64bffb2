//! Replacements of removed flags, for users who still type them.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Commands that produce estimates.
const ESTIMATE: [&str; 3] = ["filter", "smooth", "live"];
/// Commands that read recordings but no stream.
const RECORDINGS: [&str; 5] = ["calibrate", "refine", "fit-law", "smooth", "evaluate"];

/// Returns the replacement for an unknown flag that this command once had.
pub fn answer(error: &clap::Error, command: &str) -> Option<String> {
    let ErrorKind::UnknownArgument = error.kind() else { return None };
    let Some(ContextValue::String(flag)) = error.get(ContextKind::InvalidArg) else { return None };
    let (estimates, reads) = (ESTIMATE.contains(&command), RECORDINGS.contains(&command));
    let answer = match flag.strip_prefix("--")? {
        "no-correction" if estimates || command == "evaluate" => "it is `--without correction` now".to_owned(),
        name @ ("no-plausibility" | "no-second-look" | "no-doubts") if estimates => {
            format!("it is `--without {}` now", name.trim_start_matches("no-"))
        }
        name @ ("strain-unit" | "resistance-unit") if estimates || reads => {
            format!("it is `--unit {}=UNIT` now", name.trim_end_matches("-unit"))
        }
        name @ ("gauge-length-mm" | "front-end" | "joint") if reads => format!(
            "a line `# {} = …` above the header says it, which `ohmstrain import --{name}` writes",
            name.replace('-', "_")
        ),
        _ => return None,
    };
    Some(answer)
}
