use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use ohmstrain::{
    Calibrated, Calibration, Error, GaugeFamily, Prior, TemperatureCoefficients, calibration_doubts, motion_doubts,
};
use ohmstrain_calib::{Samples, screen};
use pyo3::prelude::*;
use pyo3_arrow::PyTable;

use crate::about::About;
use crate::doubts::{called, on_one_clock, raised_or_warned};
use crate::error::{Place, Stopped, check_signals, of_library, raise};
use crate::evaluation::{Scored, after_split};
use crate::options::{estimator, wrong};
use crate::recording::Recording;
use crate::sensor::Sensor;

/// Choices of a calibration.
#[derive(Debug, Default, FromPyObject)]
#[pyo3(from_item_all)]
pub struct Choices {
    estimator: Option<String>,
    branches: Option<usize>,
    gauge: Option<String>,
    /// The text of a `prior.toml`.
    prior: Option<String>,
    /// True if a late reference is moved.
    align: bool,
    /// Coefficients of temperature with their standard deviations: R₀'s and the gain's.
    temperature: Option<((f64, f64), (f64, f64))>,
}

impl Choices {
    fn prior(&self) -> PyResult<Option<Prior>> {
        self.prior.as_deref().map(parsed).transpose()
    }

    fn calibration<'a>(&self, prior: Option<&'a Prior>) -> PyResult<Calibration<'a>> {
        let mut calibration = Calibration::new();
        if let Some(prior) = prior {
            calibration = calibration.prior(prior);
        }
        if let Some((rest_per_k, gain_per_k)) = self.temperature {
            calibration = calibration.temperature(TemperatureCoefficients { rest_per_k, gain_per_k });
        }
        if let Some(kind) = self.estimator.as_deref().map(estimator).transpose()?.flatten() {
            calibration = calibration.estimator(kind);
        }
        if let Some(branches) = self.branches {
            if branches > 4 {
                return Err(raise(&Place::default(), &format!("branches: expected 0 to 4, found {branches}")));
            }
            calibration = calibration.branches(branches);
        }
        let Some(wanted) = self.gauge.as_deref().filter(|wanted| *wanted != "auto") else { return Ok(calibration) };
        let family: Result<GaugeFamily, String> = wanted.parse();
        Ok(calibration.gauge(family.map_err(|expected| wrong("gauge", expected, wanted))?))
    }
}

/// Refuses choices of which one is not known, before there is a recording.
#[pyfunction]
pub fn check_choices(choices: Choices) -> PyResult<()> {
    let prior = choices.prior()?;
    choices.calibration(prior.as_ref()).map(|_| ())
}

/// Calibrates a sensor on recordings with a reference; returns it with the warnings.
#[pyfunction]
pub fn calibrate(py: Python, tables: Vec<(PyTable, About)>, choices: Choices) -> PyResult<(Sensor, Vec<String>)> {
    let mut recordings =
        tables.into_iter().map(|(table, about)| Recording::new(table, about)).collect::<PyResult<Vec<Recording>>>()?;
    let mut warnings = py.detach(|| on_one_clock(&mut recordings, choices.align))?;
    let whole: Vec<usize> = recordings.iter().map(|recording| recording.time_s.len()).collect();
    let prior = choices.prior()?;
    let (sensor, more) = calibrated(py, &recordings, &whole, choices.calibration(prior.as_ref())?)?;
    warnings.extend(more);
    Ok((sensor, warnings))
}

fn parsed(text: &str) -> PyResult<Prior> {
    Prior::from_toml(text).map_err(|error| of_library(&error, None))
}

/// Learns the common prior of sensors of one make, as the text of a `prior.toml`.
#[pyfunction]
pub fn fit_prior(py: Python, sensors: Vec<PyRef<Sensor>>) -> PyResult<String> {
    let sensors: Vec<ohmstrain::Sensor> = sensors.iter().map(|sensor| sensor.sensor.clone()).collect();
    let text = py.detach(|| Prior::learn(&sensors)?.to_toml());
    text.map_err(|error| of_library(&error, None))
}

/// Refuses a text that is not a prior.
#[pyfunction]
pub fn check_prior(text: &str, file: Option<&str>) -> PyResult<()> {
    Prior::from_toml(text).map(|_| ()).map_err(|error| of_library(&error, file))
}

/// Calibrates a sensor on the first `rows` of each recording; returns it with the warnings.
pub fn calibrated(
    py: Python,
    recordings: &[Recording],
    rows: &[usize],
    calibration: Calibration,
) -> PyResult<(Sensor, Vec<String>)> {
    for recording in recordings {
        if recording.reference.is_none() {
            let place = Place { file: recording.name.as_deref(), column: Some("strain"), row: None };
            return Err(raise(&place, "expected a reference (strain, displacement_mm or angle_deg), found none"));
        }
    }
    // Unwinding is the only way to stop a calibration.
    let made = catch_unwind(AssertUnwindSafe(|| py.detach(|| run(recordings, rows, calibration))));
    let made = made.or_else(|stopped| match stopped.downcast::<PyErr>() {
        Ok(interrupt) => Err(*interrupt),
        Err(panicked) => resume_unwind(panicked),
    })?;
    let (calibrated, warnings) = made.map_err(|stopped| match stopped {
        Stopped::Interrupted(raised) => raised,
        Stopped::Refused(error) => {
            let name = if let [one] = recordings { one.name.as_deref() } else { None };
            of_library(&error, name)
        }
    })?;
    Ok((Sensor { sensor: calibrated.sensor }, warnings))
}

/// Calibrates as the command line does: untrustworthy rows are left out first, and doubts are raised.
fn run(
    recordings: &[Recording],
    rows: &[usize],
    calibration: Calibration,
) -> Result<(Calibrated, Vec<String>), Stopped> {
    let parts = recordings.iter().zip(rows).map(|(recording, rows)| recording.until(*rows));
    let parts: Vec<_> = parts.collect();
    let samples = parts.iter().map(|(time_s, reading, strain)| Samples::new(time_s, reading, strain.unwrap_or(&[])));
    let samples = samples.collect::<Result<Vec<_>, _>>().map_err(Error::from)?;
    let as_read = recordings.iter().zip(&samples).map(|(recording, samples)| recording.known(samples));
    let as_read = as_read.collect::<Result<Vec<_>, _>>()?;
    let mut warnings = raised_or_warned(recordings, &motion_doubts(&as_read)).map_err(Stopped::Interrupted)?;
    let screened = screen(&samples).map_err(Error::from)?;
    let known = recordings.iter().zip(screened.samples()).map(|(recording, samples)| recording.known(&samples));
    let known = known.collect::<Result<Vec<_>, _>>()?;
    warnings.extend(raised_or_warned(recordings, &calibration_doubts(&known)).map_err(Stopped::Interrupted)?);
    let left_out = screened.distrusted.iter().map(|one| {
        let name = called(recordings, one.recording);
        format!("{name}: row {} ({} s): {}; left out of the calibration", one.row, one.time_s, one.doubt)
    });
    warnings.extend(left_out);
    let interrupted = |error: PyErr| resume_unwind(Box::new(error));
    let calibrated = calibration.run_with(&known, |_| check_signals().unwrap_or_else(interrupted))?;
    warnings.extend(raised_or_warned(recordings, &calibrated.doubts()).map_err(Stopped::Interrupted)?);
    Ok((calibrated, warnings))
}

/// Calibrates on the first rows of a recording and scores the rest; returns the sensor, the warnings, and the scores as JSON.
#[pyfunction]
pub fn evaluate_split(
    py: Python,
    table: PyTable,
    about: About,
    choices: Choices,
    share: f64,
) -> PyResult<(Sensor, Vec<String>, Scored)> {
    if !(share > 0.0 && share < 1.0) {
        return Err(raise(&Place::default(), &format!("splits: expected shares between 0 and 1, found {share}")));
    }
    let recording = Recording::new(table, about)?;
    let rows = (recording.time_s.len() as f64 * share) as usize;
    let recordings = [recording];
    let (sensor, warnings) = calibrated(py, &recordings, &[rows], choices.calibration(None)?)?;
    let [mut recording] = recordings;
    let suited = recording.convert_for(&sensor.sensor);
    let scored = after_split(py, &recording, rows, &suited)?;
    Ok((sensor, warnings, scored))
}
