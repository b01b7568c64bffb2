//! Doubts of the library: refusals are raised, the others are warnings.

use ohmstrain::{CalibrationDoubt, Interface, Known, LagAnswer};
use ohmstrain_calib::{Samples, aligned};
use pyo3::prelude::*;

use crate::error::{Place, of_library, raise};
use crate::recording::Recording;

/// Returns the name of a recording in messages: its own, or its number.
pub fn called(recordings: &[Recording], place: usize) -> String {
    let name = recordings.get(place).and_then(|recording| recording.name.as_deref());
    name.map_or_else(|| format!("recording {}", place + 1), str::to_owned)
}

/// Returns the warnings about a calibration; raises the first doubt that needs an answer.
pub fn raised_or_warned(recordings: &[Recording], doubts: &[CalibrationDoubt]) -> PyResult<Vec<String>> {
    let mut warnings = Vec::new();
    for doubt in doubts {
        let places = doubt.recordings();
        let names: Vec<String> = places.iter().map(|place| called(recordings, *place)).collect();
        let text = doubt.text(Interface::Python);
        if doubt.is_refusal() {
            return Err(raise(&Place { file: Some(&names.join(" and ")), ..Place::default() }, &text));
        }
        warnings.push(if names.is_empty() { text } else { format!("{}: {text}", names.join(" and ")) });
    }
    Ok(warnings)
}

/// Moves late references if requested; refuses those that are certainly too late, and warns of those that may be.
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
        match doubt.answer(align, Interface::Python) {
            LagAnswer::Move(lag, text) => {
                warnings.push(format!("{name}: {text}"));
                let moved = aligned(&samples, lag.lag_s);
                recording.reference.iter_mut().for_each(|(_, values)| values.clone_from(&moved));
            }
            LagAnswer::Refuse(text) => return Err(raise(&Place { file: Some(&name), ..Place::default() }, &text)),
            LagAnswer::Warn(text) => warnings.push(format!("{name}: {text}")),
            LagAnswer::Remark(_) => {}
        }
    }
    Ok(warnings)
}

/// Returns doubts about known strains, in a recording whose first and last time, s, are `times`.
pub fn of_known(sensor: &ohmstrain::Sensor, start: Option<f64>, known: &[Known], times: (f64, f64)) -> Vec<String> {
    let start = start.and_then(|start| sensor.check_start(start).err()).map(|doubt| doubt.text(Interface::Python));
    let unused = ohmstrain::unused_known(known, times).into_iter().map(|doubt| doubt.text(Interface::Python));
    start.into_iter().chain(unused).collect()
}
