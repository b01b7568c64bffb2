//! Recordings with a column of readings for each of several channels.

use std::path::{Path, PathBuf};

use ohmstrain::trace::TraceFile;
use ohmstrain_bench_data::{Metadata, ParquetText};

use crate::error::CliError;
use crate::input;
use crate::whole_file;

/// Columns of readings in a recording of one channel.
pub const ONE_CHANNEL: [&str; 3] = ["resistance_ohm", "resistance_ratio", "adc"];
/// Columns of a recording that every channel keeps.
pub const KEPT: [&str; 3] = ["time_s", "time_us", "temperature_c"];
/// The mark with which spreadsheet programs begin a CSV in UTF-8.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();
/// Endings of columns of readings, each with its column in a recording of one channel.
const READINGS: [(&str, &str); 3] = [("_ohm", "resistance_ohm"), ("_ratio", "resistance_ratio"), ("_adc", "adc")];
/// Endings of columns of references, each with its column in a recording of one channel.
const REFERENCES: [(&str, &str); 4] =
    [("angle_deg", "angle_deg"), ("strain", "strain"), ("displacement_mm", "displacement_mm"), ("deg", "angle_deg")];

/// A recording of several channels, as text.
pub struct Table {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Byte range of the header in the text.
    header: (usize, usize),
    columns: Vec<String>,
    sha256: String,
}

/// A column of readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name in the recording.
    pub column: String,
    /// The name without its unit.
    pub name: String,
    /// Its column in a recording of one channel.
    known: &'static str,
    /// The column of its reference.
    pub reference: String,
}

impl Table {
    /// Reads a recording; `None` if it is one of a single channel, or no table of this kind.
    pub fn read(path: &Path) -> Result<Option<Self>, CliError> {
        if whole_file::is_stdin(path) || !path.is_file() {
            return Ok(None);
        }
        let mut bytes = whole_file::bytes(path)?;
        if bytes.starts_with(BYTE_ORDER_MARK) {
            bytes.drain(..BYTE_ORDER_MARK.len());
        }
        if ParquetText::is_one(&bytes) {
            return Ok(None);
        }
        let Some(header) = header(&bytes) else { return Ok(None) };
        let text = String::from_utf8_lossy(&bytes[header.0..header.1]);
        let columns: Vec<String> =
            text.split(',').map(|name| name.trim().trim_matches('"').trim().to_owned()).collect();
        let readings = columns.iter().filter(|name| reading(name).is_some()).count();
        if readings < 2 || columns.iter().any(|name| ONE_CHANNEL.contains(&name.as_str())) {
            return Ok(None);
        }
        let sha256 = input::sha256_of(path).map_err(|error| CliError::file("read", path, &error))?;
        Ok(Some(Self { path: path.to_path_buf(), bytes, header, columns, sha256 }))
    }

    /// Returns the columns of readings, each with its reference: the one of the same name (`index_ohm`, `index_angle_deg`), or
    /// else one for all channels (`strain`, `angle_deg`, or the only one in the file).
    pub fn channels(&self) -> Result<Vec<Channel>, CliError> {
        self.columns
            .iter()
            .filter_map(|column| Some((column, reading(column)?)))
            .map(|found| self.channel(found))
            .collect()
    }

    fn channel(&self, (column, (name, known)): (&String, (&str, &'static str))) -> Result<Channel, CliError> {
        let references = || self.columns.iter().filter(|column| reference(column).is_some());
        let is_own = |found: &&String| reference(found).is_some_and(|(stem, _)| stem == name);
        let is_of_all = |found: &&String| reference(found).is_some_and(|(stem, _)| stem.is_empty());
        let only = || references().next().filter(|_| references().count() == 1);
        let found = references().find(is_own).or_else(|| references().find(is_of_all)).or_else(only);
        let Some(found) = found else {
            let all = references().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            let all = if all.is_empty() { "none".into() } else { all };
            return Err(CliError::Input(format!(
                "{}: column `{column}`: expected its reference, `{name}_angle_deg`, `{name}_strain` or `{name}_displacement_mm`, or \
                 one for all channels without `{name}_`, found {all}",
                self.header_name()
            )));
        };
        Ok(Channel { column: column.clone(), name: name.into(), known, reference: found.clone() })
    }

    /// Returns the recording of one channel.
    pub fn trace(&self, channel: &Channel, overrides: &Metadata) -> Result<TraceFile, CliError> {
        let own = channel.known;
        let known = reference(&channel.reference).map_or("_", |(_, known)| known);
        let sd = deviation(&channel.reference);
        let known_sd = deviation(known).unwrap_or_default();
        let header = masked(self.columns.iter().map(String::as_str), |_, name| match name {
            name if name == channel.column => Some(own),
            name if name == channel.reference => Some(known),
            name if Some(name) == sd.as_deref() => Some(known_sd.as_str()),
            name => KEPT.contains(&name).then_some(name),
        });
        let bytes = [&self.bytes[..self.header.0], header.as_bytes(), &self.bytes[self.header.1..]].concat();
        // Messages name the column of this file, not the one that stands for it in a recording of one channel.
        let named = |text: String| {
            let text = text.replace(&format!("column `{own}`"), &format!("column `{}`", channel.column));
            text.replace(&format!("column `{known}`"), &format!("column `{}`", channel.reference))
        };
        let trace = input::parse(&bytes, &self.path, overrides).map_err(|error| match error {
            CliError::Input(text) => CliError::Input(named(text)),
            other => other,
        })?;
        Ok(TraceFile { sha256: self.sha256.clone(), ..trace })
    }

    /// Returns the file and the line of its header.
    pub fn header_name(&self) -> String {
        let line = 1 + self.bytes[..self.header.0].iter().filter(|byte| **byte == b'\n').count();
        format!("{}:{line}", self.path.display())
    }
}

/// Returns a header for one channel: columns have the names that `known` makes of place and name; those without one are ignored.
pub fn masked<'c>(columns: impl Iterator<Item = &'c str>, known: impl Fn(usize, &'c str) -> Option<&'c str>) -> String {
    let names = columns.enumerate().map(|(place, name)| known(place, name).unwrap_or("_"));
    names.collect::<Vec<_>>().join(",")
}

/// Returns the name of a column of readings without its unit, and its column in a recording of one channel.
pub fn reading(column: &str) -> Option<(&str, &'static str)> {
    let found = READINGS.into_iter().find_map(|(ending, known)| Some((column.strip_suffix(ending)?, known)));
    found.filter(|(name, _)| !name.is_empty())
}

/// Returns the name of a reference's column without its quantity, and its column in a recording of one channel.
pub fn reference(column: &str) -> Option<(&str, &'static str)> {
    let of = |(ending, known): &(&'static str, &'static str)| {
        let stem = column.strip_suffix(ending)?;
        let stem = if stem.is_empty() { Some(stem) } else { stem.strip_suffix('_') };
        // `deg` alone is no name.
        stem.filter(|stem| !stem.is_empty() || ending == known).map(|stem| (stem, *known))
    };
    REFERENCES.iter().find_map(of)
}

/// Returns the name of the column with a reference's standard deviation: `index_angle_sd` of `index_angle_deg`, `strain_sd` of
/// `strain`.
fn deviation(reference: &str) -> Option<String> {
    let angle = reference.strip_suffix("angle_deg").map(|stem| format!("{stem}angle_sd"));
    angle.or_else(|| reference.strip_suffix("strain").map(|stem| format!("{stem}strain_sd")))
}

/// True if a column is a reference, or the standard deviation of one.
pub fn is_reference(column: &str) -> bool {
    let of = |ending: &str| column.strip_suffix(ending).is_some_and(|stem| stem.is_empty() || stem.ends_with('_'));
    reference(column).is_some() || of("angle_sd") || of("strain_sd")
}

/// Returns the byte range of the first line that is neither empty nor a comment.
fn header(bytes: &[u8]) -> Option<(usize, usize)> {
    let mut start = 0;
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        if !text.is_empty() && !text.starts_with(b"#") {
            return Some((start, start + line.trim_ascii_end().len()));
        }
        start += line.len();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{deviation, header, is_reference, reading, reference};

    #[test]
    fn columns_are_recognised_by_their_endings() {
        assert!(reading("knit1_ratio").is_some_and(|(name, _)| name == "knit1"));
        assert!(reading("_ohm").is_none() && reading("ohm").is_none() && reading("time_s").is_none());
        assert_eq!(reference("angle_deg"), Some(("", "angle_deg")));
        assert_eq!(reference("index_angle_deg"), Some(("index", "angle_deg")));
        assert_eq!(reference("index_deg"), Some(("index", "angle_deg")));
        assert_eq!(reference("index_strain"), Some(("index", "strain")));
        assert!(reference("deg").is_none() && reference("restrain").is_none());
        assert_eq!(deviation("index_angle_deg").as_deref(), Some("index_angle_sd"));
        assert_eq!(deviation("strain").as_deref(), Some("strain_sd"));
        assert!(deviation("index_deg").is_none() && is_reference("index_strain_sd") && !is_reference("index_sd"));
    }

    #[test]
    fn the_header_stands_below_comments() {
        let text = b"# sensor = 7\n\ntime_s,a_ohm\r\n0,1\n";
        let (start, end) = header(text).unwrap();
        assert_eq!(&text[start..end], b"time_s,a_ohm");
    }
}
