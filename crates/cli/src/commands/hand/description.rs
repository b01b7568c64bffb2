use std::path::Path;

use ohmstrain::trace::HandDescription;

use crate::error::CliError;
use crate::sensor_file;
use crate::whole_file;

/// Reads `hand.toml`.
///
/// # Errors
/// If it cannot be read, is a recording or a sensor, or has an unknown field.
pub fn read(path: &Path) -> Result<HandDescription, CliError> {
    let name = path.display().to_string();
    let text = whole_file::text(path)?;
    if sensor_file::is_recording(&text) {
        return Err(CliError::Input(format!(
            "{name} is a recording, not the description of a hand: give hand.toml first, and the recording after it"
        )));
    }
    if text.contains("\ndefault_estimator = ") {
        let what = "is a sensor file: hand.toml names it as the `sensor` of a joint";
        return Err(CliError::Input(format!("{name} {what}")));
    }
    HandDescription::from_toml(&text).map_err(|error| CliError::Input(error.in_file(&name)))
}
