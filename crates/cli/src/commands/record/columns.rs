//! Columns of a recorded stream, and those that a protocol adds.

use ohmstrain_bench_data::pacing::{Pacing, Position};
use ohmstrain_bench_data::{Line, LineParser, Metadata, ReferenceQuantity, Row, cells};

use crate::channels::{self, KEPT, ONE_CHANNEL};
use crate::port::Due;

/// Lines of a stream: a parser for each column of readings.
pub struct Columns {
    channels: Vec<Channel>,
    /// Columns that are written after the time.
    written: Vec<Written>,
}

/// A column of readings.
struct Channel {
    name: String,
    /// Its name in a recording of one channel.
    known: String,
    lines: LineParser,
}

/// A column that is written.
struct Written {
    name: String,
    /// Index of its cell in a line.
    index: usize,
    /// Index of the channel whose reading it is.
    channel: Option<usize>,
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
        let Some(names) = header_cells(header) else { return Ok(None) };
        let readings = readings(&names);
        if let Some(joint) = pacing.joints.iter().find(|joint| readings.iter().all(|(_, stem, _)| stem != joint)) {
            return Err(format!(
                "joint `{joint}` of the protocol: expected a column `{joint}_ohm`, `{joint}_ratio` or `{joint}_adc`, found `{header}`"
            ));
        }
        let channel = |(index, _, known): &(usize, &str, &str)| {
            let lines = LineParser::new(name, overrides.clone());
            Channel { name: names[*index].clone(), known: (*known).to_owned(), lines }
        };
        let written = |(index, name): (usize, &String)| {
            let is_written = !channels::is_reference(name) && !["time_s", "time_us", "mark"].contains(&name.as_str());
            let channel = readings.iter().position(|(place, ..)| *place == index);
            is_written.then(|| Written { name: name.clone(), index, channel })
        };
        let mut columns = Self {
            channels: readings.iter().map(channel).collect(),
            written: names.iter().enumerate().filter_map(written).collect(),
        };
        remarks.iter().for_each(|remark| columns.remark(remark));
        columns.begin(&names)?;
        Ok(Some(columns))
    }

    /// Takes a line with `#`: metadata of a header to come, or a remark.
    pub fn remark(&mut self, line: &str) {
        for channel in &mut self.channels {
            // A remark without metadata is ignored, as in any stream.
            let _ = channel.lines.take(line.as_bytes());
        }
    }

    /// Passes the header to each channel's parser, in a form in which its column is the reading.
    fn begin(&mut self, names: &[String]) -> Result<(), String> {
        for channel in &mut self.channels {
            let masked = channels::masked(names.iter().map(String::as_str), |_, name| {
                if name == channel.name { Some(channel.known.as_str()) } else { KEPT.contains(&name).then_some(name) }
            });
            channel.lines.take(masked.as_bytes()).map_err(|fault| fault.to_string())?;
        }
        Ok(())
    }

    /// Begins anew if a line is a header, as a device sends it after a restart; its columns may have another order. Returns false if it
    /// is not a header.
    ///
    /// # Errors
    /// If a column is missing, or the electronics are others than those above the first header.
    pub fn restart(&mut self, line: &str) -> Result<bool, String> {
        let Some(names) = header_cells(line) else { return Ok(false) };
        for column in &mut self.written {
            let index = names.iter().position(|name| *name == column.name);
            column.index =
                index.ok_or_else(|| format!("expected the column `{}` as before, found `{line}`", column.name))?;
        }
        let electronics = |columns: &Self| columns.metadata().front_end;
        let before = electronics(self);
        self.begin(&names)?;
        if electronics(self) == before {
            return Ok(true);
        }
        let shown = |spec: Option<_>| spec.map_or_else(|| "none".to_owned(), |spec| format!("`{spec}`"));
        Err(format!("expected front_end {} as before, found {}", shown(before), shown(electronics(self))))
    }

    /// Returns the number of columns of readings.
    pub const fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Returns the header of the recording.
    pub fn header(&self, pacing: &Pacing) -> String {
        let names = self.written.iter().map(|column| quoted(&column.name));
        std::iter::once("time_s".to_owned()).chain(names).chain(known_names(pacing)).collect::<Vec<_>>().join(",")
    }

    /// Returns the stream's metadata with the overrides, in the units in which rows are written.
    pub fn metadata(&self) -> Metadata {
        // The maker of a recording that is played back did not make this one.
        let mut metadata = self.channels.first().map_or_else(Metadata::default, |channel| channel.lines.metadata());
        metadata.other.retain(|(key, _)| key != "made_by");
        metadata
    }

    /// Parses a line into a row.
    ///
    /// # Errors
    /// The fault of a channel.
    pub fn row(&mut self, line: &str) -> Result<Option<Due<StreamRow>>, String> {
        let parsers = self.channels.iter_mut().map(|channel| &mut channel.lines);
        let taken = LineParser::take_together(parsers, line.as_bytes()).map_err(|(index, fault)| {
            let channel = &self.channels[index];
            fault.renamed(&channel.known, &channel.name).to_string()
        })?;
        let restarted = taken.iter().any(|line| matches!(line, Line::Restarted(_)));
        let rows: Vec<Row> = taken.into_iter().filter_map(Line::row).collect();
        let (Some(first), Some(cells)) = (rows.first(), cells(line)) else { return Ok(None) };
        let cell = |column: &Written| match column.channel {
            // Codes stay; other readings are written in the unit of the metadata.
            Some(channel) if !self.channels[channel].lines.has_codes() => {
                rows.get(channel).map_or_else(String::new, |row| number(row.reading.value))
            }
            _ => cells.get(column.index).map_or_else(String::new, |cell| quoted(cell)),
        };
        let cells = self.written.iter().map(cell).collect::<Vec<_>>().join(",");
        let row = StreamRow { cells, reading: first.reading.value };
        Ok(Some(Due { row, time_s: first.time_s, restarted }))
    }
}

/// Returns the names in a header; `None` for a line without a column of times or without one of readings.
fn header_cells(line: &str) -> Option<Vec<String>> {
    let names = cells(line)?;
    let has_time = names.iter().any(|name| name == "time_s" || name == "time_us");
    (has_time && !readings(&names).is_empty()).then_some(names)
}

/// Returns the columns of readings: index, name without the unit, and name in a recording of one channel.
fn readings(names: &[String]) -> Vec<(usize, &str, &str)> {
    let named = || names.iter().map(String::as_str).enumerate();
    match named().find(|(_, name)| ONE_CHANNEL.contains(name)) {
        Some((index, name)) => vec![(index, "", name)],
        None => named()
            .filter_map(|(index, name)| channels::reading(name).map(|(stem, known)| (index, stem, known)))
            .collect(),
    }
}

/// Returns a cell with a number; an empty one for NaN.
fn number(value: f64) -> String {
    if value.is_nan() { String::new() } else { value.to_string() }
}

/// Returns a cell with text, in quotation marks where it needs them.
fn quoted(text: &str) -> String {
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
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
