//! Columns of a recorded stream, and those that a protocol adds.

use ohmstrain_bench_data::pacing::{Pacing, Position};
use ohmstrain_bench_data::{Line, LineParser, Metadata, ReferenceQuantity};

use crate::channels::{self, KEPT, ONE_CHANNEL};
use crate::port::Due;

/// Lines of a stream: a parser for each column of readings.
pub struct Columns {
    names: Vec<String>,
    channels: Vec<LineParser>,
    /// The header in the form that each channel's parser takes.
    masked: Vec<String>,
    /// Indices of the cells that are written after the time.
    written: Vec<usize>,
}

/// A row of a stream.
pub struct StreamRow {
    /// Cells to be written after the time.
    pub cells: String,
    /// The first channel's reading; NaN if it is missing.
    pub reading: f64,
}

impl Columns {
    /// Parses a header; `None` if the line is not one. `remarks` are the lines with `#` above it.
    ///
    /// # Errors
    /// If a joint of the protocol has no column of readings, or a unit is missing.
    pub fn of(
        header: &str,
        (name, overrides, remarks): (&str, &Metadata, &[String]),
        pacing: &Pacing,
    ) -> Result<Option<Self>, String> {
        let names: Vec<String> = header.split(',').map(|name| name.trim().to_owned()).collect();
        if !names.iter().any(|name| name == "time_s" || name == "time_us") {
            return Ok(None);
        }
        let one = names.iter().position(|name| ONE_CHANNEL.contains(&name.as_str()));
        let readings: Vec<(usize, &str, &str)> = match one {
            Some(place) => vec![(place, "", names[place].as_str())],
            None => names
                .iter()
                .enumerate()
                .filter_map(|(place, name)| channels::reading(name).map(|(stem, known)| (place, stem, known)))
                .collect(),
        };
        if readings.is_empty() {
            return Ok(None);
        }
        if let Some(joint) = pacing.joints.iter().find(|joint| readings.iter().all(|(_, stem, _)| stem != joint)) {
            return Err(format!(
                "joint `{joint}` of the protocol: expected a column `{joint}_ohm`, `{joint}_ratio` or `{joint}_adc`, found `{header}`"
            ));
        }
        let (mut channels, mut headers) = (Vec::with_capacity(readings.len()), Vec::with_capacity(readings.len()));
        for (place, _, known) in &readings {
            let masked = channels::masked(names.iter().map(String::as_str), |k, name| {
                if k == *place { Some(*known) } else { KEPT.contains(&name).then_some(name) }
            });
            let mut lines = LineParser::new(name, overrides.clone());
            for remark in remarks {
                // A remark without metadata is ignored, as in any stream.
                let _ = lines.take(remark.as_bytes());
            }
            lines.take(masked.as_bytes()).map_err(|fault| fault.to_string())?;
            channels.push(lines);
            headers.push(masked);
        }
        let is_written =
            |name: &String| !channels::is_reference(name) && !["time_s", "time_us", "mark"].contains(&name.as_str());
        let written = (0..names.len()).filter(|k| is_written(&names[*k])).collect();
        Ok(Some(Self { names, channels, masked: headers, written }))
    }

    /// True if a line repeats the header, as a device sends it after a restart.
    pub fn is_header(&self, line: &str) -> bool {
        line.split(',').map(str::trim).eq(self.names.iter().map(String::as_str))
    }

    /// Returns the number of columns of readings.
    pub const fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Returns the header of the recording.
    pub fn header(&self, pacing: &Pacing) -> String {
        let names = self.written.iter().map(|k| self.names[*k].clone());
        std::iter::once("time_s".to_owned()).chain(names).chain(known_names(pacing)).collect::<Vec<_>>().join(",")
    }

    /// Returns the stream's metadata with the overrides.
    pub fn metadata(&self) -> Metadata {
        // The maker of a recording that is played back did not make this one.
        let mut metadata = self.channels.first().map_or_else(Metadata::default, LineParser::metadata);
        metadata.other.retain(|(key, _)| key != "made_by");
        metadata
    }

    /// Parses a line into a row.
    ///
    /// # Errors
    /// The first channel's fault.
    pub fn row(&mut self, line: &str) -> Result<Option<Due<StreamRow>>, String> {
        let mut first = None;
        let mut restarted = false;
        for lines in &mut self.channels {
            match lines.take(line.as_bytes()).map_err(|fault| fault.to_string())? {
                Line::Row(row) => first = first.or(Some(row)),
                Line::Restarted(row) => {
                    first = first.or(Some(row));
                    restarted = true;
                }
                _ => {}
            }
        }
        let Some(row) = first else { return Ok(None) };
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let cells = self.written.iter().map(|k| cells.get(*k).copied().unwrap_or_default()).collect::<Vec<_>>();
        let row_of = StreamRow { cells: cells.join(","), reading: row.reading.value };
        Ok(Some(Due { row: row_of, time_s: row.time_s, restarted }))
    }

    /// Accepts any time for the next row, after the device has restarted.
    pub fn restart(&mut self) {
        for (lines, header) in self.channels.iter_mut().zip(&self.masked) {
            let _ = lines.take(header.as_bytes());
        }
    }
}

/// Returns the names of the columns that a protocol adds.
fn known_names(pacing: &Pacing) -> Vec<String> {
    let [value, sd] = match pacing.quantity {
        ReferenceQuantity::Strain => ["strain", "strain_sd"],
        ReferenceQuantity::AngleDeg => ["angle_deg", "angle_sd"],
    };
    match &pacing.joints[..] {
        [] => vec![value.into(), sd.into()],
        joints => joints.iter().flat_map(|joint| [format!("{joint}_{value}"), format!("{joint}_{sd}")]).collect(),
    }
}

/// Returns the cells of the columns that a protocol adds; empty if the strain is unknown.
pub fn known_cells(pacing: &Pacing, held: Option<usize>) -> String {
    let cells = |position: &Position| {
        let pairs = position.values.iter().map(|value| format!("{value},{}", position.sd));
        pairs.collect::<Vec<_>>().join(",")
    };
    let unknown = || vec![","; pacing.joints.len().max(1)].join(",");
    held.and_then(|place| pacing.positions.get(place)).map_or_else(unknown, cells)
}
