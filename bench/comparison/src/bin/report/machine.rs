//! Machine and tools of the measurements.

use std::error::Error;
use std::process::Command;

/// Describes, in one sentence, processor, cores, compiler, and duration of the measurements.
pub fn describe(mode: &str) -> Result<String, Box<dyn Error>> {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let mut lines = cpu.lines().filter_map(|line| line.split_once(':'));
        lines.find(|(key, _)| key.trim() == name).map_or("unknown", |(_, value)| value.trim()).to_owned()
    };
    let cores = std::thread::available_parallelism()?;
    let rustc = String::from_utf8(Command::new("rustc").arg("--version").output()?.stdout)?;
    Ok(format!(
        "{} (family {}, model {}), {cores} cores; {}; {mode}",
        field("model name"),
        field("cpu family"),
        field("model"),
        rustc.trim()
    ))
}
