use csv::StringRecord;

use crate::clock::LastTime;
use crate::columns::{Column, Columns};
use crate::error::{BadContent, Fault};
use crate::lines::take_apart;
use crate::metadata::Metadata;
use crate::row::{ReadingKind, ReferenceQuantity, Row};
use crate::row_parser::RowParser;

/// Number of successive late lines, each later than the one before, after which the clock counts as restarted.
const LATE_LINES: u32 = 3;
/// Longest line of a device, bytes.
const LONGEST_LINE: usize = 4096;

/// Parses a trace line by line, as a device sends it. A line that is not part of a trace is an error of that line alone. A header may be
/// repeated at any time, and the clock may restart.
///
/// ```
/// use ohmstrain_bench_data::{Line, LineParser, Metadata};
/// let mut lines = LineParser::new("/dev/ttyACM0", Metadata::default());
/// assert!(lines.take(b"05,16").is_err());
/// assert!(matches!(lines.take(b"time_s,resistance_ohm"), Ok(Line::Header)));
/// let Ok(Line::Row(row)) = lines.take(b"0.05,1600\r\n") else { panic!() };
/// assert_eq!(row.reading.value, 1600.0);
/// ```
pub struct LineParser {
    name: String,
    overrides: Metadata,
    /// Metadata since the last header, if any.
    before_header: Option<Metadata>,
    stream: Option<Stream>,
    number: u64,
    record: StringRecord,
}

/// State since a header.
struct Stream {
    columns: Columns,
    /// Metadata with the overrides.
    metadata: Metadata,
    parser: RowParser,
    late: Option<Late>,
}

/// Parser with the clock of the late rows, and their number.
type Late = (RowParser, u32);

/// Parser with the clock of a stream, and that of its late rows.
type Clocks = (RowParser, Option<Late>);

/// Kind of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Line {
    /// A row.
    Row(Row),
    /// The first row after a restart of the clock.
    Restarted(Row),
    /// A header; columns, and information on the sensor, may have changed.
    Header,
    /// A blank line, metadata or a remark.
    Nothing,
}

impl Line {
    /// Returns the row of a line that is one.
    #[must_use]
    pub const fn row(self) -> Option<Row> {
        match self {
            Self::Row(row) | Self::Restarted(row) => Some(row),
            Self::Header | Self::Nothing => None,
        }
    }
}

impl LineParser {
    /// Waits for a header. `name` is the source's name in errors, `overrides` replaces the stream's metadata.
    #[must_use]
    pub fn new(name: &str, overrides: Metadata) -> Self {
        let record = StringRecord::new();
        Self { name: name.into(), overrides, before_header: None, stream: None, number: 0, record }
    }

    /// Returns the stream's metadata above its last header, or above the first header if that is still to come, with the overrides; units
    /// are those of rows.
    #[must_use]
    pub fn metadata(&self) -> Metadata {
        self.stream.as_ref().map_or_else(|| self.above(), |stream| stream.metadata.clone()).in_own_units(true)
    }

    /// Returns the metadata for a header that arrives now; one without lines above it keeps the metadata of the previous header.
    fn above(&self) -> Metadata {
        let before = self.stream.as_ref().map(|stream| &stream.metadata);
        let mut metadata = self.before_header.as_ref().or(before).cloned().unwrap_or_default();
        metadata.override_with(&self.overrides);
        metadata
    }

    /// Returns the kind of the readings; `None` before the header.
    #[must_use]
    pub fn reading_kind(&self) -> Option<ReadingKind> {
        self.stream.as_ref().map(|stream| stream.parser.reading_kind())
    }

    /// True if rows since the last header have temperatures.
    #[must_use]
    pub fn has_temperature(&self) -> bool {
        self.stream.as_ref().is_some_and(|stream| stream.parser.has_temperature())
    }

    /// True if the readings are converter codes.
    #[must_use]
    pub fn has_codes(&self) -> bool {
        self.stream.as_ref().is_some_and(|stream| stream.parser.has_codes())
    }

    /// Returns the quantity of the reference, if there is one.
    #[must_use]
    pub fn reference_quantity(&self) -> Option<ReferenceQuantity> {
        self.stream.as_ref().and_then(|stream| stream.parser.reference_quantity())
    }

    /// Returns the names of the columns in which rows since the last header are recorded: that of the reading, and those of the reference
    /// and the temperature, if there are any; none before the header.
    pub fn recorded_columns(&self) -> impl Iterator<Item = &'static str> + use<> {
        let reading = self.stream.as_ref().map(|stream| stream.columns.reading.column);
        let reference = self.reference_quantity().map(Column::of_reference);
        let temperature = self.has_temperature().then_some(Column::TemperatureC);
        reading.into_iter().chain(reference).chain(temperature).map(Column::name)
    }

    /// Returns the numbers of a row in these columns: the reading, as a code if it is one, the reference and the temperature.
    pub fn recorded(&self, row: &Row) -> impl Iterator<Item = f64> + use<> {
        let code = row.reading.code.map_or(f64::NAN, f64::from);
        let reading = if self.has_codes() { code } else { row.reading.value };
        let reference = self.reference_quantity().map(|_| row.reference);
        let temperature_c = self.has_temperature().then_some(row.temperature_c);
        std::iter::once(reading).chain(reference).chain(temperature_c)
    }

    /// Returns the time of the last row, as in the source.
    pub(crate) fn last_time(&self) -> Option<LastTime> {
        self.stream.as_ref().and_then(|stream| stream.parser.last_time())
    }

    /// Continues from the last time of a previous stream: the first row must be later, and a counter may have wrapped. Returns `false` if
    /// that stream used another unit of time.
    pub(crate) fn go_on(&mut self, from: LastTime) -> bool {
        self.stream.as_mut().is_some_and(|stream| stream.parser.clock().go_on(from))
    }

    /// Parses a line, with or without its end.
    ///
    /// # Errors
    /// If it is not part of a trace; parsing then continues as if the line were absent.
    pub fn take(&mut self, line: &[u8]) -> Result<Line, BadContent> {
        self.number += 1;
        self.of_line(line).map_err(|fault| fault.at(&self.name, self.number))
    }

    /// Parses a line with several parsers, one for each column of readings. A line that one of them refuses is a row for none: it leaves the
    /// clocks of the others as they were.
    ///
    /// # Errors
    /// The fault, and the index of the parser that found it; faulty content is reported before a late time.
    pub fn take_together<'p>(
        parsers: impl IntoIterator<Item = &'p mut Self>,
        line: &[u8],
    ) -> Result<Vec<Line>, (usize, BadContent)> {
        let mut parsers: Vec<&mut Self> = parsers.into_iter().collect();
        let clocks: Vec<Option<Clocks>> = parsers.iter().map(|parser| parser.clocks()).collect();
        let taken: Vec<Result<Line, BadContent>> = parsers.iter_mut().map(|parser| parser.take(line)).collect();
        let fault = |is_late: bool| {
            let found = taken.iter().enumerate().filter_map(|(index, taken)| Some((index, taken.as_ref().err()?)));
            found.into_iter().find(|(_, fault)| fault.is_late == is_late).map(|(index, fault)| (index, fault.clone()))
        };
        let Some(fault) = fault(false).or_else(|| fault(true)) else {
            return Ok(taken.into_iter().flatten().collect());
        };
        for ((parser, clocks), taken) in parsers.into_iter().zip(clocks).zip(&taken) {
            // Late lines count towards a restart of the clock.
            if taken.is_ok() || !fault.1.is_late {
                parser.restore(clocks);
            }
        }
        Err(fault)
    }

    fn clocks(&self) -> Option<Clocks> {
        self.stream.as_ref().map(|stream| (stream.parser, stream.late))
    }

    fn restore(&mut self, clocks: Option<Clocks>) {
        if let (Some(stream), Some((parser, late))) = (&mut self.stream, clocks) {
            (stream.parser, stream.late) = (parser, late);
        }
    }

    /// Parses the line with this number.
    pub(crate) fn take_numbered(&mut self, line: &str, number: u64) -> Result<Line, Fault> {
        self.number = number;
        self.of_line(line.as_bytes())
    }

    fn of_line(&mut self, line: &[u8]) -> Result<Line, Fault> {
        if line.len() > LONGEST_LINE {
            return Err(Fault::new(format!("a line of at most {LONGEST_LINE} bytes"), "a longer one"));
        }
        let text = std::str::from_utf8(line).map_err(|_| Fault::new("UTF-8 text", "other bytes"))?;
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() {
            return Ok(Line::Nothing);
        }
        // A remark without `=` is no metadata of the header to come.
        if text.starts_with('#') && !text.contains('=') {
            return Ok(Line::Nothing);
        }
        if text.starts_with('#') {
            return self.before_header.get_or_insert_default().take_line(text).map(|()| Line::Nothing);
        }
        take_apart(text, &mut self.record)?;
        match (Columns::of_header(&self.record), &mut self.stream) {
            (Ok(columns), _) => self.begin(columns),
            (Err(_), Some(stream)) => stream.take(&self.record, self.number),
            // The fault states which columns a header has.
            (Err(fault), None) => Err(fault),
        }
    }

    fn begin(&mut self, columns: Columns) -> Result<Line, Fault> {
        let metadata = self.above();
        let parser = RowParser::new(columns, &metadata)?;
        self.stream = Some(Stream { columns, metadata, parser, late: None });
        self.before_header = None;
        Ok(Line::Header)
    }
}

impl Stream {
    fn take(&mut self, record: &StringRecord, number: u64) -> Result<Line, Fault> {
        let fault = match self.parser.row(record, number) {
            Ok(row) => {
                self.late = None;
                return Ok(Line::Row(row));
            }
            Err(fault) => fault,
        };
        if !fault.is_late {
            return Err(fault);
        }
        let (mut clock, mut count) = match self.late.take() {
            Some(late) => late,
            None => (RowParser::new(self.columns, &self.metadata)?, 0),
        };
        let mut row = clock.row(record, number);
        if row.is_err() {
            // The row is also late by the clock of the late rows.
            (clock, count) = (RowParser::new(self.columns, &self.metadata)?, 0);
            row = clock.row(record, number);
        }
        count += 1;
        if count == LATE_LINES {
            self.parser = clock;
            return row.map(Line::Restarted);
        }
        self.late = Some((clock, count));
        Err(fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(lines: &[&str]) -> Vec<Option<f64>> {
        let mut parser = LineParser::new("-", Metadata::default());
        let time = |line: Line| match line {
            Line::Row(row) | Line::Restarted(row) => Some(row.time_s),
            _ => None,
        };
        lines.iter().map(|line| parser.take(line.as_bytes()).ok().and_then(time)).collect()
    }

    #[test]
    fn garbage_is_one_line_and_leaves_the_clock() {
        let lines = ["time_s,resistance_ohm", "1,1600", "9e9,-3", "\"7", "2,x,3", "2,1600"];
        assert_eq!(times(&lines), [None, Some(1.0), None, None, None, Some(2.0)]);
    }

    #[test]
    fn a_line_that_one_of_several_parsers_refuses_leaves_the_clocks() {
        let header = ["time_s,resistance_ohm,_", "time_s,_,resistance_ohm"];
        let mut parsers = header.map(|_| LineParser::new("-", Metadata::default()));
        for (parser, header) in parsers.iter_mut().zip(header) {
            assert!(parser.take(header.as_bytes()).is_ok());
        }
        let mut take = |line: &str| LineParser::take_together(&mut parsers, line.as_bytes());
        let is_row = |taken: &Result<Vec<Line>, _>| matches!(taken, Ok(lines) if matches!(lines[..], [Line::Row(_), Line::Row(_)]));
        assert!(is_row(&take("1,1600,1700")));
        let (index, fault) = take("9999,1600,x").unwrap_err();
        assert!(index == 1 && !fault.is_late, "{fault}");
        assert!(is_row(&take("2,1600,1700")));
        // A corrupt line does not count among the late ones, and both clocks restart with the third.
        let late = ["0.1,1600,1700", "9999,1600,x", "0.2,1600,1700", "0.3,1600,1700"].map(take);
        assert!(late[..3].iter().all(Result::is_err), "{late:?}");
        assert!(matches!(late[3].as_deref(), Ok([Line::Restarted(_), Line::Restarted(_)])), "{late:?}");
    }

    #[test]
    fn a_clock_restarts_after_three_lines_or_a_header() {
        let lines = ["time_s,resistance_ohm", "90,1600", "1,1600", "91,1600", "0,1", "1,1", "2,1", "3,1"];
        let known = [None, Some(90.0), None, Some(91.0), None, None, Some(2.0), Some(3.0)];
        assert_eq!(times(&lines), known);
        // Late rows whose times do not increase are not a restarted clock.
        let lines = ["time_s,resistance_ohm", "90,1600", "5,1600", "4,1600", "4,1600", "3,1600", "91,1600"];
        assert_eq!(times(&lines), [None, Some(90.0), None, None, None, None, Some(91.0)]);
        let lines = ["time_s,resistance_ohm", "90,1600", "time_us,resistance_ohm", "5000000,1600"];
        assert_eq!(times(&lines), [None, Some(90.0), None, Some(5.0)]);
    }

    /// A record has the cells as they came: codes rather than ohms, temperatures rather than their effect.
    #[test]
    fn a_row_is_recorded_with_its_temperature() {
        let mut parser = LineParser::new("-", Metadata::default());
        let code = "# front_end = divider reference_ohm=10000 side=low bits=12 noise_codes=0.5";
        for line in [code, "temperature_c,time_us,note,adc,strain"] {
            assert!(parser.take(line.as_bytes()).is_ok());
        }
        let columns: Vec<&str> = parser.recorded_columns().collect();
        assert_eq!(columns, ["adc", "strain", "temperature_c"]);
        let mut recorded = |line: &str| match parser.take(line.as_bytes()) {
            Ok(Line::Row(row)) => parser.recorded(&row).map(|number| number.to_string()).collect::<Vec<_>>(),
            other => panic!("{other:?}"),
        };
        assert_eq!(recorded("31.5,5000,x,512,0.25"), ["512", "0.25", "31.5"]);
        assert_eq!(recorded(",6000,x,,0.25"), ["NaN", "0.25", "NaN"]);
        assert!(parser.take(b"time_s,resistance_ohm").is_ok());
        assert_eq!(parser.recorded_columns().collect::<Vec<_>>(), ["resistance_ohm"]);
    }

    #[test]
    fn what_came_before_a_header_belongs_to_it() {
        let mut parser = LineParser::new("-", Metadata::default());
        let code = "# front_end = divider reference_ohm=10000 side=low bits=12 noise_codes=0.5";
        for line in [code, "time_us,adc"] {
            assert!(parser.take(line.as_bytes()).is_ok());
        }
        assert!(parser.metadata().front_end.is_some());
        assert!(matches!(parser.take(b"5000,512"), Ok(Line::Row(row)) if row.reading.sd_ohm.is_some()));
        // A remark is not metadata; a restarted clock still needs the metadata.
        assert!(parser.take(b"# warm now").is_ok() && parser.metadata().front_end.is_some());
        let lines = [&b"1,512"[..], b"2,512", b"3,512"].map(|line| parser.take(line));
        assert!(matches!(lines[2], Ok(Line::Restarted(row)) if row.reading.sd_ohm.is_some()), "{lines:?}");
        assert!(parser.take(b"time_us,adc").is_ok() && parser.metadata().front_end.is_some());
    }
}
