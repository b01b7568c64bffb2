use ohmstrain::{Estimate, Interface, Known, QuietWatch, ValidityWatch};
use pyo3_arrow::PyRecordBatch;

use crate::recording::Recording;

/// Estimates and what casts doubt on them.
pub type Doubtful = (PyRecordBatch, Vec<String>);

/// Says when the calibration does not reach.
pub struct Watch {
    watch: ValidityWatch,
    quiet: QuietWatch,
    /// What it has said.
    pub warnings: Vec<String>,
}

impl Watch {
    /// Of a sensor, what it reads at rest, if that is said, and strains that are known.
    pub fn new(sensor: &ohmstrain::Sensor, rest_resistance: Option<f64>, known: &[Known]) -> Self {
        let watch = ValidityWatch::new(sensor, rest_resistance);
        Self { watch, quiet: QuietWatch::new(sensor, rest_resistance, known), warnings: Vec::new() }
    }

    /// Takes a row of a recording with its estimated rate.
    pub fn see(&mut self, recording: &Recording, row: usize, rate: f64) {
        let (time_s, reading) = recording.row(row);
        let seen = self.watch.see(time_s, reading.value, rate, f64::NAN);
        self.warnings.extend(seen.map(|warning| format!("{}{warning}", recording.before())));
    }

    /// Takes what a filter says of a row, and asks whether a long hold was a rest.
    pub fn see_rest(&mut self, recording: &Recording, estimate: &Estimate) {
        let quiet = self.quiet.see(estimate);
        self.warnings.extend(quiet.map(|quiet| format!("{}{}", recording.before(), quiet.text(Interface::Python))));
    }
}
