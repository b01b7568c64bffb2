//! Columns of a stream that is recorded, and those that a protocol adds.

use ohmstrain_bench_data::pacing::{Pacing, Position};
use ohmstrain_bench_data::{Line, LineParser, Metadata, ReferenceQuantity};

use crate::channels::{self, ONE_CHANNEL};
use crate::port::Due;

/// Columns that are none of a reading, and are kept under their names.
const KEPT: [&str; 2] = ["time_us", "temperature_c"];

/// Lines of a stream: a parser for each column of readings.
pub struct Columns {
    names: Vec<String>,
    channels: Vec<LineParser>,
    /// The header as each channel's parser takes it.
    masked: Vec<String>,
    /// Places of the cells that are written beside the time.
    written: Vec<usize>,
}

/// A row of a stream.
pub struct StreamRow {
    /// Cells as they are written, after the time.
    pub cells: String,
    /// The first channel's reading; NaN if it is missing.
    pub reading: f64,
}

impl Columns {
    /// Columns of a header; `None` if it is none. `remarks` are the lines with `#` above it.
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
            let kept = |name: &str| KEPT.contains(&name) || name == "time_s";
            let masked = |(k, name): (usize, &String)| match k == *place {
                true => (*known).to_owned(),
                false if kept(name) => name.clone(),
                false => "_".to_owned(),
            };
            let masked = names.iter().enumerate().map(masked).collect::<Vec<_>>().join(",");
            let mut lines = LineParser::new(name, overrides.clone());
            for remark in remarks {
                // A remark that is none is passed over as it is in a stream.
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

    /// True if a line is the header again, as a device sends it that has started anew.
    pub fn is_header(&self, line: &str) -> bool {
        line.split(',').map(str::trim).eq(self.names.iter().map(String::as_str))
    }

    /// Number of columns of readings.
    pub const fn channels(&self) -> usize {
        self.channels.len()
    }

    /// The header of the recording.
    pub fn header(&self, pacing: &Pacing) -> String {
        let names = self.written.iter().map(|k| self.names[*k].clone());
        std::iter::once("time_s".to_owned()).chain(names).chain(known_names(pacing)).collect::<Vec<_>>().join(",")
    }

    /// Returns the stream's metadata with the overrides.
    pub fn metadata(&self) -> Metadata {
        // Who made what is played back did not make this.
        let mut metadata = self.channels.first().map_or_else(Metadata::default, LineParser::metadata);
        metadata.other.retain(|(key, _)| key != "made_by");
        metadata
    }

    /// The row of a line.
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

    /// The device has started anew: any time may come.
    pub fn restart(&mut self) {
        for (lines, header) in self.channels.iter_mut().zip(&self.masked) {
            let _ = lines.take(header.as_bytes());
        }
    }
}

/// Names of the columns that a protocol adds.
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

/// Cells of the columns that a protocol adds: empty where nothing is known.
pub fn known_cells(pacing: &Pacing, held: Option<usize>) -> String {
    let cells = |position: &Position| {
        let pairs = position.values.iter().map(|value| format!("{value},{}", position.sd));
        pairs.collect::<Vec<_>>().join(",")
    };
    let unknown = || vec![","; pacing.joints.len().max(1)].join(",");
    held.and_then(|place| pacing.positions.get(place)).map_or_else(unknown, cells)
}
