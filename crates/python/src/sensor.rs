use ohmstrain::{Closing, EstimatorKind, JointParams, Quantity, ReadingUnit};
use pyo3::prelude::*;
use pyo3_arrow::PyTable;

use crate::about::About;
use crate::doubts::of_known;
use crate::error::{Place, of_library, raise};
use crate::evaluation::{self, Scored};
use crate::firmware::{self, Exported};
use crate::live::{LaggedFilter, LiveFilter, stored};
use crate::options::Options;
use crate::recording::Recording;
use crate::table::Estimates;
use crate::watch::{Doubtful, Watch};

/// A calibrated sensor.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct Sensor {
    pub(crate) sensor: ohmstrain::Sensor,
}

impl Sensor {
    /// Returns warnings about the use of a recording for this sensor.
    fn use_doubts(&self, recording: &Recording) -> Vec<String> {
        let missing = self.sensor.no_temperatures_doubt().filter(|_| !recording.has_temperatures());
        let missing = missing.map(|doubt| recording.doubted(doubt));
        missing.into_iter().chain(recording.use_doubts(&self.sensor, true)).collect()
    }

    /// Converts the readings of a recording to the sensor's reference temperature and checks them; returns the sensor on its joint, if it
    /// has one.
    fn for_recording(&self, recording: &mut Recording, options: &Options) -> PyResult<ohmstrain::Sensor> {
        let sensor = recording.convert_for(&self.sensor);
        recording.check_kind(&sensor)?;
        recording.check_unit(&sensor, options.rest_resistance(&sensor)?)?;
        on_joint(sensor, recording.joint, recording.name.as_deref())
    }
}

/// Returns the sensor on its joint, if it has one.
pub fn on_joint(
    sensor: ohmstrain::Sensor,
    joint: Option<JointParams>,
    file: Option<&str>,
) -> PyResult<ohmstrain::Sensor> {
    match joint {
        None => Ok(sensor),
        Some(joint) => sensor.on_joint(joint).map_err(|error| of_library(&error, file)),
    }
}

#[pymethods]
impl Sensor {
    /// Returns the sensor for readings whose temperature is not measured.
    fn without_temperature(&self) -> Self {
        Self { sensor: self.sensor.clone().without_temperature() }
    }

    /// Returns the sensor on a joint.
    fn on_joint(&self, joint: String) -> PyResult<Self> {
        let joint = About { joint: Some(joint), ..About::default() }.joint()?;
        Ok(Self { sensor: on_joint(self.sensor.clone(), joint, None)? })
    }

    #[staticmethod]
    #[pyo3(signature = (text, file=None, estimator=None))]
    fn from_toml(text: &str, file: Option<&str>, estimator: Option<&str>) -> PyResult<Self> {
        let kind = estimator.map(crate::options::estimator).transpose()?.flatten();
        let sensor = match kind {
            Some(kind) => ohmstrain::Sensor::from_toml_for(text, kind),
            None => ohmstrain::Sensor::from_toml(text),
        };
        Ok(Self { sensor: sensor.map_err(|error| of_library(&error, file))? })
    }

    fn to_toml(&self) -> PyResult<String> {
        self.sensor.to_toml().map_err(|error| of_library(&error, None))
    }

    /// Returns the summary of the calibration: names and sentences.
    fn closing(&self, file: Option<&str>) -> Option<Vec<(&'static str, String)>> {
        let params = self.sensor.params();
        let findings = Some(params.findings.as_ref()?);
        Some(Closing { file, params, findings, tested: None, calibration_s: None, more: "findings" }.lines())
    }

    /// Returns all numbers as JSON.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(self.sensor.params()).map_err(|error| raise(&Place::default(), &error.to_string()))
    }

    #[getter]
    fn quantity(&self) -> &'static str {
        match self.sensor.params().quantity {
            Quantity::Strain => "strain",
            Quantity::AngleDeg => "angle_deg",
        }
    }

    #[getter]
    fn reading(&self) -> &'static str {
        match self.sensor.params().reading {
            ReadingUnit::Ohm => "resistance_ohm",
            ReadingUnit::Ratio => "resistance_ratio",
        }
    }

    #[getter]
    fn estimator(&self) -> &'static str {
        EstimatorKind::name(self.sensor.params().default_estimator)
    }

    /// Returns the names of the columns of its estimates, for a recording on a joint if there is one.
    fn columns(&self, about: About, options: Options) -> PyResult<Vec<&'static str>> {
        let sensor = on_joint(self.sensor.clone(), about.joint()?, None)?;
        Ok(options.columns(&sensor)?.iter().map(ohmstrain::Column::name).collect())
    }

    /// Creates a filter for live readings, on a joint if there is one.
    #[pyo3(signature = (options, about=About::default()))]
    fn live(&self, options: Options, about: About) -> PyResult<LiveFilter> {
        let sensor = on_joint(self.sensor.clone(), about.joint()?, None)?;
        let filter = options.builder(&sensor)?.build().map_err(|error| of_library(&error, None))?;
        let (columns, rest) = (options.columns(&sensor)?, options.rest_resistance(&sensor)?);
        Ok(LiveFilter::new(filter, sensor, columns, rest, options.known.clone()))
    }

    fn lagged(&self, options: Options, lag_s: f64) -> PyResult<LaggedFilter> {
        let filter = options.builder(&self.sensor)?.build_lagged(lag_s).map_err(|error| of_library(&error, None))?;
        Ok(LaggedFilter::new(filter, &self.sensor, options.columns(&self.sensor)?, None))
    }

    /// Resumes a filter from a state.
    #[pyo3(signature = (options, state, file=None))]
    fn resume(&self, options: Options, state: &str, file: Option<&str>) -> PyResult<LiveFilter> {
        let stored = stored(state, file)?;
        let filter = options.builder(&self.sensor)?.resume(&stored).map_err(|error| of_library(&error, file))?;
        let (columns, given) = (options.columns(&self.sensor)?, options.rest_resistance(&self.sensor)?);
        Ok(LiveFilter::resumed(filter, self.sensor.clone(), columns, given, options.known.clone(), stored))
    }

    /// Resumes a filter with a lag.
    #[pyo3(signature = (options, lag_s, state, file=None))]
    fn resume_lagged(&self, options: Options, lag_s: f64, state: &str, file: Option<&str>) -> PyResult<LaggedFilter> {
        let stored = stored(state, file)?;
        let filter = options.builder(&self.sensor)?.resume_lagged(lag_s, &stored);
        let filter = filter.map_err(|error| of_library(&error, file))?;
        Ok(LaggedFilter::new(filter, &self.sensor, options.columns(&self.sensor)?, stored.temperature_c))
    }

    fn filter(&self, py: Python, table: PyTable, about: About, options: Options) -> PyResult<Doubtful> {
        let mut recording = Recording::new(table, about)?;
        let sensor = self.for_recording(&mut recording, &options)?;
        let rest = options.rest_resistance(&sensor)?;
        let columns = options.columns(&sensor)?;
        let mut filter = options.builder(&sensor)?.build().map_err(|error| recording.refused(&error))?;
        let (estimates, warnings) = py.detach(|| {
            let mut estimates = Estimates::new(columns, recording.time_s.len());
            let mut watch = Watch::new(&sensor, rest, &options.known);
            watch.warnings = self.use_doubts(&recording);
            watch.warnings.extend(of_known(&sensor, options.initial_strain, &options.known, recording.times()));
            recording.filtered(&mut filter, |row, estimate| {
                estimates.put(row, std::slice::from_ref(estimate));
                watch.see(&recording, row, estimate.strain_rate);
                watch.see_rest(&recording, estimate);
            })?;
            Ok::<_, PyErr>((estimates, watch.warnings))
        })?;
        Ok((estimates.into_batch()?, warnings))
    }

    fn smooth(&self, py: Python, table: PyTable, about: About, options: Options) -> PyResult<Doubtful> {
        let mut recording = Recording::new(table, about)?;
        let sensor = self.for_recording(&mut recording, &options)?;
        let (builder, rest) = (options.builder(&sensor)?, options.rest_resistance(&sensor)?);
        let columns = options.columns(&sensor)?;
        let (estimates, warnings) = py.detach(|| {
            let len = recording.time_s.len();
            let mut estimates = Estimates::new(columns, len);
            let mut rates = vec![0.0; len];
            recording.smoothed(builder, |rows, segment| {
                estimates.put(rows.start, segment);
                rates[rows].iter_mut().zip(segment).for_each(|(rate, row)| *rate = row.strain_rate);
            })?;
            let mut watch = Watch::new(&sensor, rest, &options.known);
            watch.warnings = self.use_doubts(&recording);
            watch.warnings.extend(of_known(&sensor, options.initial_strain, &options.known, recording.times()));
            rates.iter().enumerate().for_each(|(row, rate)| watch.see(&recording, row, *rate));
            Ok::<_, PyErr>((estimates, watch.warnings))
        })?;
        Ok((estimates.into_batch()?, warnings))
    }

    fn evaluate(&self, py: Python, table: PyTable, about: About, options: Options, from_s: f64) -> PyResult<Scored> {
        let mut recording = Recording::new(table, about)?;
        let sensor = self.for_recording(&mut recording, &options)?;
        evaluation::with_sensor(py, &recording, &sensor, &options, from_s)
    }

    /// Returns the filter as source code for a microcontroller.
    fn export(
        &self,
        py: Python,
        target: &str,
        dt_s: Option<f64>,
        budget: Option<&str>,
        prefix: &str,
    ) -> PyResult<Exported> {
        py.detach(|| firmware::exported(self.sensor.params(), target, dt_s, budget, prefix))
    }
}
