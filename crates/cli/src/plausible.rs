//! What recordings given to a calibration say about their units, and about being of one sensor.

use ohmstrain::number::{plain, significant};
use ohmstrain_bench_data::{ReadingKind, ReferenceQuantity};
use ohmstrain_calib::{Distrusted, LARGEST_SD_SCALE, Screened, SensorParams};

use crate::error::CliError;
use crate::input::TraceFile;

/// Strains beyond this are taken for percent until somebody says that they are none: four times its own length.
const LARGEST_STRAIN: f64 = 3.0;
/// Above a strain of one, readings that change by less than this per strain are taken for it, too.
const LEAST_GAUGE: f64 = 0.05;
/// Median readings below this, Ω, are taken for kΩ until somebody says that they are none.
const LEAST_OHM: f64 = 20.0;
/// Ratios between recordings that no sensor explains, so that it must be the unit.
const UNIT_RATIO: f64 = 20.0;
/// Ratios between recordings of one sensor that are worth a word: R₀ drifts by a tenth or two from day to day, and the
/// readings' change per strain depends on how it is led.
const REST_RATIO: f64 = 1.3;
const GAUGE_RATIO: f64 = 3.0;
/// Rows named one by one.
const NAMED_ROWS: usize = 5;

/// What a recording is about, in three figures.
struct Figures {
    median_reading: f64,
    /// Largest magnitude of the reference.
    largest: f64,
    /// Range of the readings over their median, per range of the reference.
    gauge: f64,
}

impl Figures {
    /// `None` if nothing is known or moves.
    fn new(reading: &[f64], reference: &[f64]) -> Option<Self> {
        let sorted = |values: &[f64]| {
            let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            known.sort_by(f64::total_cmp);
            known
        };
        let (readings, references) = (sorted(reading), sorted(reference));
        let median_reading = *readings.get(readings.len() / 2)?;
        let span = references.last()? - references.first()?;
        let largest = references.last()?.abs().max(references.first()?.abs());
        let gauge = (readings.last()? - readings.first()?) / median_reading / span;
        (span > 0.0).then_some(Self { median_reading, largest, gauge })
    }
}

/// Asks about units that cannot be meant, and about recordings that cannot be of one sensor.
pub fn check(recordings: &[TraceFile], screened: &Screened) -> Result<(), CliError> {
    let mut known: Vec<(&TraceFile, Figures)> = Vec::new();
    for (recording, samples) in recordings.iter().zip(screened.samples()) {
        let Some(figures) = Figures::new(samples.reading(), samples.strain()) else { continue };
        check_units(recording, &figures)?;
        known.push((recording, figures));
    }
    let pair = |of: fn(&Figures) -> f64| {
        let least = known.iter().min_by(|a, b| of(&a.1).total_cmp(&of(&b.1)))?;
        let most = known.iter().max_by(|a, b| of(&a.1).total_cmp(&of(&b.1)))?;
        Some((least.0, of(&least.1), most.0, of(&most.1)))
    };
    if let Some((a, least, b, most)) =
        pair(|figures| figures.median_reading).filter(|pair| pair.3 > UNIT_RATIO * pair.1)
    {
        return Err(CliError::Input(format!(
            "{} and {}: readings of about {} and {}, {:.0} times as much; expected one sensor in one unit; is \
             one of them in kilo-ohms? Then put `# resistance_unit = kohm` above its header",
            a.name,
            b.name,
            plain(least),
            plain(most),
            most / least
        )));
    }
    if let Some((a, least, b, most)) = pair(|figures| figures.gauge).filter(|pair| pair.3 > UNIT_RATIO * pair.1) {
        return Err(CliError::Input(format!(
            "{} and {}: the readings change by {least:.3} and {most:.3} of their median per unit of the reference, {:.0} times \
             as much; expected one sensor and one unit; is the reference of {} in percent? Then put `# strain_unit = percent` \
             above its header",
            a.name,
            b.name,
            most / least,
            a.name
        )));
    }
    if let Some((a, least, b, most)) = pair(|figures| figures.gauge).filter(|pair| pair.3 > GAUGE_RATIO * pair.1) {
        CliError::warning(&format!(
            "the readings change by {least:.3} of their median per unit of the reference in {}, by {most:.3} in {}: one \
             sensor?",
            a.name, b.name
        ));
    }
    Ok(())
}

fn check_units(recording: &TraceFile, figures: &Figures) -> Result<(), CliError> {
    let (trace, Figures { median_reading, largest, gauge }) = (&recording.trace, figures);
    let is_strain = trace.reference.as_ref().is_some_and(|reference| reference.quantity == ReferenceQuantity::Strain);
    let percent = *largest > LARGEST_STRAIN || (*largest > 1.0 && *gauge < LEAST_GAUGE);
    if is_strain && trace.metadata.strain_unit.is_none() && percent {
        return Err(CliError::Input(format!(
            "{}: expected the reference as a fraction of the length, found strains of up to {}, over which the \
             readings change by {gauge:.3} of their median per strain; if they are in percent, say so with `--strain-unit \
             percent` or a line `# strain_unit = percent` above the header, if not with `fraction`",
            recording.header,
            plain(*largest)
        )));
    }
    let is_ohm = trace.readings.kind == ReadingKind::Ohm && trace.readings.converter.is_none();
    if is_ohm && trace.metadata.resistance_unit.is_none() && *median_reading < LEAST_OHM {
        return Err(CliError::Input(format!(
            "{}: column `resistance_ohm`: expected ohms, found readings of about {}; if they are in \
             kilo-ohms, say so with `--resistance-unit kohm` or a line `# resistance_unit = kohm` above the header, if not \
             with `ohm`",
            recording.header,
            plain(*median_reading)
        )));
    }
    Ok(())
}

/// Says when one recording was given twice.
pub fn warn_of_copies(recordings: &[TraceFile]) {
    for (k, recording) in recordings.iter().enumerate() {
        if let Some(first) = recordings[..k].iter().find(|first| first.sha256 == recording.sha256) {
            let text = format!("{} has the same content as {}: its rows count twice", recording.name, first.name);
            CliError::warning(&text);
        }
    }
}

/// Says which recordings rest at a resistance that one sensor hardly has.
pub fn warn_of_rests(recordings: &[TraceFile], params: &SensorParams) {
    let rests = || recordings.iter().zip(&params.recordings).map(|(recording, info)| (recording, info.rest_reading));
    let least = rests().min_by(|a, b| a.1.total_cmp(&b.1));
    let most = rests().max_by(|a, b| a.1.total_cmp(&b.1));
    let (Some((a, least)), Some((b, most))) = (least, most) else { return };
    if most > REST_RATIO * least {
        CliError::warning(&format!(
            "R0 comes out as {} in {}, as {} in {}, {:.0} % more: one sensor?",
            significant(least, 5),
            a.name,
            significant(most, 5),
            b.name,
            100.0 * (most / least - 1.0)
        ));
    }
}

/// Says whose intervals the law is too wrong for.
pub fn warn_of_intervals(params: &SensorParams) {
    for of in params.widened_most() {
        CliError::warning(&format!(
            "the {of}'s intervals are widened by {LARGEST_SD_SCALE}, the most there is: on parts of the recordings that it has \
             not seen, the law is more wrong than they say; another recording, or other branches, may help (--explain)"
        ));
    }
}

/// Says which rows took no part in a calibration; the first ones, or all of them.
pub fn distrusted(recordings: &[TraceFile], distrusted: &[Distrusted]) -> Vec<String> {
    let line = |one: &Distrusted| {
        let recording = &recordings[one.recording];
        let row = recording.first_row + one.row + 1;
        format!("{}: data row {row} ({} s): {}; left out of the calibration", recording.name, one.time_s, one.doubt)
    };
    distrusted.iter().map(line).collect()
}

/// The same on stderr, the first ones.
pub fn warn_of_distrusted(recordings: &[TraceFile], rows: &[Distrusted]) {
    let lines = distrusted(recordings, rows);
    lines.iter().take(NAMED_ROWS).for_each(|line| CliError::warning(line));
    if lines.len() > NAMED_ROWS {
        CliError::warning(&format!("{} more rows are left out; --explain names all", lines.len() - NAMED_ROWS));
    }
}
