use std::fmt::Display;

use ohmstrain_calib::{Lag, LagError, clock_lag};

use crate::Trace;
use crate::columns::Column;
use crate::counted::counted;
use crate::error::{TraceError, quote};
use crate::import::error::ImportError;
use crate::import::roles::{Align, Channel, Decision, FileColumn, Timed};
use crate::import::series::{Series, Times, Values, alternation, check_positive, converted, folded, spurious_zeros};
use crate::import::table::{Table, all_files};
use crate::import::trace::plan::Plan;
use crate::import::words::Role;
use crate::metadata::{Metadata, ResistanceUnit, StrainUnit};
use crate::rows::RowWriter;

/// Largest number of texts for missing values that a remark lists.
const MOST_TEXTS: usize = 8;

/// A trace made from files.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The trace.
    pub trace: Trace,
    /// Remarks on what was left out, filled in or noticed, one line each.
    pub remarks: Vec<String>,
    /// Lag that was subtracted from the reference's clock, if it was found by the motion.
    pub lag: Option<Lag>,
    /// Number of rows omitted because they had the time of the previous row.
    pub duplicates: usize,
    /// Amplitude by which neighbouring readings alternated, relative to their size, if they did; the current's polarity then alternates.
    pub alternation: Option<f64>,
}

impl Plan {
    /// Makes the trace, with remarks on the conversion.
    ///
    /// # Errors
    /// [`ImportError`] for cells that are not numbers, times that decrease, and motion that does not determine the lag of the clocks.
    pub fn import(&self, tables: &[Table]) -> Result<Imported, ImportError> {
        match self.recipe.recording {
            Some(number) => self.import_all(&self.recording(tables, number)?),
            None => self.import_all(tables),
        }
    }

    fn import_all(&self, tables: &[Table]) -> Result<Imported, ImportError> {
        let Decision { reference, temperature, .. } = &self.decision;
        let first = self.decision.readings[0];
        let mut work = Work { tables, plan: self, remarks: self.remarks.clone(), lag: None, duplicates: 0 };
        let (readings, alternation, zero) = work.readings(&first)?;
        let mut columns =
            vec![(Column::TimeS, readings.time.clone()), (column(first.values.role), readings.value.clone())];
        if let Some(timed) = reference {
            let align = self.recipe.align.unwrap_or(Align::None);
            let is_same = self.decision.is_one_clock() && align == Align::None;
            let values = work.beside(timed, is_same, align, &readings, zero.as_ref())?;
            if !is_same || self.recipe.fold_polarity {
                work.check_reach(timed.values.place.file, &values)?;
            }
            columns.push((column(timed.values.role), values));
            columns.extend(work.deviation(&timed.values, is_same, &readings)?);
        }
        if let Some(values) = *temperature {
            let timed = Timed { values, ..first };
            columns.push((column(values.role), work.beside(&timed, true, Align::None, &readings, zero.as_ref())?));
        }
        work.mention_unused();
        work.mention_passed_over();
        let metadata = work.metadata(zero.map(|(_, text)| text));
        let trace = trace(&metadata, &columns, &tables[first.values.place.file].file)?;
        let Work { remarks, lag, duplicates, .. } = work;
        Ok(Imported { trace, remarks, lag, duplicates, alternation })
    }
}

/// State of an import.
pub(crate) struct Work<'a> {
    pub plan: &'a Plan,
    pub tables: &'a [Table],
    remarks: Vec<String>,
    lag: Option<Lag>,
    duplicates: usize,
}

/// The first date or time of day, ns, and its text.
type Zero = (i128, String);

impl Work<'_> {
    pub(crate) fn remark(&mut self, file: usize, text: impl Display) {
        self.remarks.push(format!("{}: {text}", self.tables[file].file));
    }

    /// Returns the readings over time, the amplitude by which neighbours alternate, and the start of the clock.
    fn readings(&mut self, timed: &Timed) -> Result<(Series, Option<f64>, Option<Zero>), ImportError> {
        let (channel, file) = (&timed.values, timed.values.place.file);
        let times = Times::read(self.tables, &timed.clock, &self.plan.recipe.missing)?;
        if times.wraps > 0 {
            self.remark(file, format!("the clock's 32-bit counter started again {}", counted(times.wraps, "time")));
        }
        let values = self.values(channel)?;
        let mut series = self.ordered(file, &times.seconds, values)?;
        let alternation = alternation(&series.value);
        if self.plan.recipe.fold_polarity {
            if channel.role == Role::Adc {
                let what = "--fold-polarity takes means of neighbours, and converter codes have none";
                return Err(ImportError::unreadable(&self.tables[file].file, what));
            }
            series = folded(&series);
            self.remark(file, "each reading is the mean of two neighbours of opposite polarity");
        } else if let Some(share) = alternation {
            let percent = 100.0 * share;
            self.remark(
                file,
                format!("neighbouring readings alternate by {percent:.1} %: --fold-polarity takes their means"),
            );
        }
        Ok((series, alternation, times.zero))
    }

    /// Returns a column's numbers after the recipe's corrections: magnitudes instead of signed values, and spurious zeros as missing
    /// values.
    fn values(&mut self, channel: &Channel) -> Result<Vec<f64>, ImportError> {
        let (file, recipe) = (channel.place.file, &self.plan.recipe);
        let Values { mut values, missing } = Values::read(self.tables, channel, &recipe.missing)?;
        let column = self.tables[file].name(channel.place.column);
        if !missing.is_empty() {
            let texts: Vec<String> =
                missing.iter().take(MOST_TEXTS).map(|(text, count)| format!("{count} × {}", quote(text))).collect();
            let others = missing.len().saturating_sub(MOST_TEXTS);
            let others = if others > 0 { format!(" and {}", counted(others, "other text")) } else { String::new() };
            self.remark(file, format!("column {column}: missing values: {}{others}", texts.join(", ")));
        }
        if recipe.magnitude.contains(&channel.role) {
            values.iter_mut().for_each(|value| *value = value.abs());
        }
        if recipe.drop_zeros.contains(&channel.role) {
            let zeros = spurious_zeros(&values, Role::READINGS.contains(&channel.role));
            zeros.iter().for_each(|row| values[*row] = f64::NAN);
            if !zeros.is_empty() {
                let zeros = counted(zeros.len(), "zero");
                self.remark(file, format!("column {column}: {zeros} left out: no reading is zero there"));
            }
        }
        if let Some((_, zero)) = recipe.zero.iter().rev().find(|(role, _)| *role == channel.role) {
            let zero = converted(*zero, channel.unit.scale);
            values.iter_mut().for_each(|value| *value -= zero);
        }
        if matches!(channel.role, Role::Resistance | Role::Ratio) {
            check_positive(self.tables, channel, &values)?;
        }
        Ok(values)
    }

    /// Returns the rows in the order of time; omitted rows are remarked.
    fn ordered(&mut self, file: usize, time: &[f64], value: Vec<f64>) -> Result<Series, ImportError> {
        let (series, untimed, repeated) = Series::ordered(&self.tables[file], time, value)?;
        if untimed > 0 {
            self.remark(file, format!("{} without a time left out", counted(untimed, "row")));
        }
        if repeated > 0 {
            self.duplicates += repeated;
            self.remark(file, format!("{} with the time of the row before left out", counted(repeated, "row")));
        }
        Ok(series)
    }

    /// Returns values at the readings' times: of the same rows, or interpolated from another clock.
    fn beside(
        &mut self,
        timed: &Timed,
        is_same: bool,
        align: Align,
        readings: &Series,
        zero: Option<&Zero>,
    ) -> Result<Vec<f64>, ImportError> {
        let values = self.values(&timed.values)?;
        if is_same && !self.plan.recipe.fold_polarity {
            return Ok(readings.row.iter().map(|row| values[*row]).collect());
        }
        let times = Times::read(self.tables, &timed.clock, &self.plan.recipe.missing)?;
        let apart = match (zero, &times.zero) {
            (Some((ours, _)), Some((theirs, _))) => (theirs - ours) as f64 / 1e9,
            _ => 0.0,
        };
        let seconds: Vec<f64> = times.seconds.iter().map(|time| time + apart).collect();
        let mut series = self.ordered(timed.clock.file(), &seconds, values)?;
        let shift = match align {
            Align::None => 0.0,
            Align::Seconds(seconds) => seconds,
            Align::Motion => self.by_motion(readings, &series)?,
        };
        series.time.iter_mut().for_each(|time| *time += shift);
        Ok(series.at(&readings.time))
    }

    /// Returns the standard deviation of a trace's reference, if the file has one. It is left out if it has other rows than the
    /// readings.
    fn deviation(
        &mut self,
        reference: &Channel,
        is_same: bool,
        readings: &Series,
    ) -> Result<Option<(Column, Vec<f64>)>, ImportError> {
        let place = reference.place;
        let table = &self.tables[place.file];
        let known = [(Column::Strain, Column::StrainSd), (Column::AngleDeg, Column::AngleSd)];
        let is_named = |known: Column, column: usize| table.columns[column].heading.trim() == known.name();
        let own = known.into_iter().find(|(of, _)| *of == column(reference.role) && is_named(*of, place.column));
        let found = own.and_then(|(_, deviation)| {
            Some((deviation, (0..table.columns.len()).find(|column| is_named(deviation, *column))?))
        });
        let Some((deviation, column)) = found else { return Ok(None) };
        if !is_same || self.plan.recipe.fold_polarity {
            self.remark(
                place.file,
                format!("column `{}` left out: the reference has a clock of its own", deviation.name()),
            );
            return Ok(None);
        }
        let channel = Channel { place: FileColumn { column, ..place }, ..*reference };
        let values = Values::read(self.tables, &channel, &self.plan.recipe.missing)?.values;
        Ok(Some((deviation, readings.row.iter().map(|row| values[*row]).collect())))
    }

    /// Refuses a reference of another time than all readings, and mentions one that does not reach some of them.
    fn check_reach(&mut self, file: usize, values: &[f64]) -> Result<(), ImportError> {
        let unknown = values.iter().filter(|value| value.is_nan()).count();
        if unknown == values.len() {
            let what = "the reference has no value at the time of any reading: the clocks differ";
            let answers = ["--align SECONDS, what to add to the reference's clock", "--align motion"];
            return Err(ImportError::question(&all_files(self.tables), what, answers.map(str::to_owned)));
        }
        if unknown > 0 {
            self.remark(file, format!("no reference within reach of {unknown} of {} readings", values.len()));
        }
        Ok(())
    }

    fn by_motion(&mut self, readings: &Series, reference: &Series) -> Result<f64, ImportError> {
        let files = all_files(self.tables);
        let found = clock_lag((&readings.time, &readings.value), (&reference.time, &reference.value));
        let lag = found.map_err(|error| {
            let answers = ["--align SECONDS, what to add to the reference's clock".to_owned()];
            ImportError::question(&files, format!("--align motion: {}", as_offset(error)), answers)
        })?;
        self.remarks.push(format!(
            "{files}: the reference's clock plus {:.3} ± {:.3} s is the readings', by the motion; a lag of the sensor itself is in it",
            -lag.lag_s, lag.sd_s
        ));
        self.lag = Some(lag);
        Ok(-lag.lag_s)
    }

    fn metadata(&self, zero: Option<String>) -> Metadata {
        let (readings, reference) = (self.plan.readings(), &self.plan.decision.reference);
        let mut metadata = self.tables[readings.place.file].metadata.clone();
        if let Some(Timed { values, .. }) = reference {
            metadata.override_with(&self.tables[values.place.file].metadata);
        }
        let recipe = &self.plan.recipe;
        let mut other = vec![("imported_from".to_owned(), all_files(self.tables))];
        other.extend(zero.map(|zero| ("time_zero".to_owned(), zero)));
        // The units are now known, so the metadata need not state them.
        let is_strain = reference.is_some_and(|it| matches!(it.values.role, Role::Strain | Role::Displacement));
        let mut metadata = Metadata { strain_unit: None, resistance_unit: None, ..metadata };
        metadata.override_with(&Metadata {
            gauge_length_mm: recipe.gauge_length_mm,
            front_end: recipe.front_end,
            joint: recipe.joint,
            strain_unit: is_strain.then_some(StrainUnit::Fraction),
            resistance_unit: (readings.role == Role::Resistance).then_some(ResistanceUnit::Ohm),
            other,
            ..Metadata::default()
        });
        metadata
    }
}

/// Writes the trace's CSV and reads it back, so that all conversions and checks are those of the trace reader.
fn trace(metadata: &Metadata, columns: &[(Column, Vec<f64>)], file: &str) -> Result<Trace, ImportError> {
    let mut rows = RowWriter::new(metadata.to_string().into_bytes());
    columns.iter().for_each(|(column, _)| rows.text(column.name()));
    let io = |error: std::io::Error| ImportError::unreadable("import", error.to_string());
    rows.end().map_err(io)?;
    for row in 0..columns[0].1.len() {
        columns.iter().for_each(|(_, values)| rows.number(values[row]));
        rows.end().map_err(io)?;
    }
    Trace::read(rows.into_inner().as_slice(), file).map_err(|error| match error {
        TraceError::Content(content) => {
            let place = content.column.map_or(String::new(), |column| format!("column `{column}`: "));
            let what = format!("{place}expected {}, found {}", content.expected, content.found);
            ImportError::unreadable(&content.file, what)
        }
        TraceError::Io { source, .. } => io(source),
    })
}

/// Returns the column of a trace for a role.
const fn column(role: Role) -> Column {
    match role {
        Role::Time | Role::ReferenceTime => Column::TimeS,
        Role::Resistance => Column::ResistanceOhm,
        Role::Ratio => Column::ResistanceRatio,
        Role::Adc => Column::Adc,
        Role::Strain => Column::Strain,
        Role::Displacement => Column::DisplacementMm,
        Role::Angle => Column::AngleDeg,
        Role::Temperature => Column::TemperatureC,
    }
}

/// Expresses an error in terms of the offset that is added to the reference's clock.
fn as_offset(error: LagError) -> LagError {
    match error {
        LagError::Repeats(best, other) => LagError::Repeats(-best, -other),
        LagError::AtEnd(end) => LagError::AtEnd(-end),
        other => other,
    }
}
