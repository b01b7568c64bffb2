//! Doubts of the library in Python's words: which argument answers them; refusals are raised, the rest are warnings.

use ohmstrain::{CalibrationDoubt, Known, LagDoubt, Quiet};
use ohmstrain_calib::{Samples, aligned};
use pyo3::prelude::*;

use crate::error::{Place, of_library, raise};
use crate::recording::Recording;

/// Name of a recording in messages: its own, or its place.
pub fn called(recordings: &[Recording], place: usize) -> String {
    let name = recordings.get(place).and_then(|recording| recording.name.as_deref());
    name.map_or_else(|| format!("recording {}", place + 1), str::to_owned)
}

/// Warnings of doubts about a calibration; the first one that has to be answered is raised.
pub fn heard(recordings: &[Recording], doubts: &[CalibrationDoubt]) -> PyResult<Vec<String>> {
    let mut warnings = Vec::new();
    for doubt in doubts {
        let places = doubt.recordings();
        let names: Vec<String> = places.iter().map(|place| called(recordings, *place)).collect();
        let text = format!("{doubt}{}", answer(doubt));
        if doubt.is_refusal() {
            return Err(raise(&Place { file: Some(&names.join(" and ")), ..Place::default() }, &text));
        }
        warnings.push(if names.is_empty() { text } else { format!("{}: {text}", names.join(" and ")) });
    }
    Ok(warnings)
}

const fn answer(doubt: &CalibrationDoubt) -> &'static str {
    match doubt {
        CalibrationDoubt::Percent { .. } => {
            "; if they are in percent, say so with strain_unit=\"percent\", if not with strain_unit=\"fraction\""
        }
        CalibrationDoubt::KiloOhm { .. } => {
            "; if they are in kilo-ohms, say so with resistance_unit=\"kohm\", if not with resistance_unit=\"ohm\""
        }
        CalibrationDoubt::ReadingsApart { .. } => " Then multiply its column by 1000",
        CalibrationDoubt::ReferencesApart { .. } => " Then divide its column by 100",
        CalibrationDoubt::Exchanged { .. } => "; if they are, exchange the names of the columns",
        CalibrationDoubt::Frozen { .. } => "; leave that part out, or put NaN in its reference",
        CalibrationDoubt::Turned { .. } => "; if it has, change it, if not say so with strain_unit=\"fraction\"",
        CalibrationDoubt::TurnedApart { .. } => " Change it",
        CalibrationDoubt::Milliseconds { .. } => "; divide them by 1000",
        _ => "",
    }
}

/// Moves references that are late if that is wanted; refuses those that are certainly too late, warns of those that may be.
pub fn on_one_clock(recordings: &mut [Recording], align: bool) -> PyResult<Vec<String>> {
    let mut warnings = Vec::new();
    for place in 0..recordings.len() {
        let name = called(recordings, place);
        let recording = &mut recordings[place];
        let Some((_, reference)) = &recording.reference else { continue };
        let refused = |error: ohmstrain::Error| of_library(&error, Some(&name));
        let samples = Samples::new(&recording.time_s, &recording.readings, reference);
        let samples = samples.map_err(|error| refused(error.into()))?;
        let Some(doubt) = recording.known(&samples).map_err(refused)?.lag_doubt() else { continue };
        match doubt {
            LagDoubt::OutOfReach { .. } | LagDoubt::Repeats { .. } => warnings.push(format!("{name}: {doubt}")),
            LagDoubt::Little(lag) | LagDoubt::Uncertain(lag) | LagDoubt::Certain(lag) if align => {
                warnings.push(format!("{name}: the reference is {lag}; it was moved by that"));
                let moved = aligned(&samples, lag.lag_s);
                recording.reference.iter_mut().for_each(|(_, values)| values.clone_from(&moved));
            }
            LagDoubt::Uncertain(_) => warnings.push(format!("{name}: {doubt} align=True moves it")),
            LagDoubt::Certain(_) => {
                let answer = "align=True moves it to where the readings say it belongs";
                return Err(raise(&Place { file: Some(&name), ..Place::default() }, &format!("{doubt}; {answer}")));
            }
            _ => {}
        }
    }
    Ok(warnings)
}

/// A long hold that may be a rest, and what tells it.
pub fn of_rest(quiet: &Quiet) -> String {
    format!("{quiet}, known=[({}, 0)] tells it", quiet.now_s)
}

/// Doubts about strains that are said to be known, in a recording from the first to the last time, s.
pub fn of_known(sensor: &ohmstrain::Sensor, start: Option<f64>, known: &[Known], times: (f64, f64)) -> Vec<String> {
    let start = start.and_then(|start| sensor.check_start(start).err()).map(|doubt| format!("initial_strain: {doubt}"));
    let unused = ohmstrain::unused_known(known, times);
    let unused = unused.iter().map(|doubt| format!("known: ({}, {}) {doubt}", doubt.known.time_s, doubt.known.strain));
    start.into_iter().chain(unused).collect()
}
