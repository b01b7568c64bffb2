use ohmstrain::{Estimate, Interface, Known, QuietWatch, Stored, ValidityWatch};
use pyo3_arrow::PyRecordBatch;

use crate::recording::Recording;

/// Estimates, and the warnings about them.
pub type Doubtful = (PyRecordBatch, Vec<String>);

/// Watch for use outside the calibrated range.
pub struct Watch {
    watch: ValidityWatch,
    quiet: QuietWatch,
    /// Warnings so far.
    pub warnings: Vec<String>,
}

impl Watch {
    /// Creates the watch for a sensor, with its reading at rest, if it was given, and known strains.
    pub fn new(sensor: &ohmstrain::Sensor, rest_resistance: Option<f64>, known: &[Known]) -> Self {
        let watch = ValidityWatch::new(sensor, rest_resistance);
        Self { watch, quiet: QuietWatch::new(sensor, rest_resistance, known), warnings: Vec::new() }
    }

    /// Stores the state of the watches.
    pub fn store(&self, stored: &mut Stored) {
        (stored.validity, stored.quiet) = (Some(self.watch.seen()), Some(self.quiet.seen()));
    }

    /// Resumes from a stored state.
    pub fn go_on(&mut self, stored: Stored) {
        stored.validity.into_iter().for_each(|seen| self.watch.go_on(seen));
        stored.quiet.into_iter().for_each(|seen| self.quiet.go_on(seen));
    }

    /// Takes a row of a recording with its estimated rate.
    pub fn see(&mut self, recording: &Recording, row: usize, rate: f64) {
        let (time_s, reading) = recording.row(row);
        let seen = self.watch.see(time_s, reading.value, rate, f64::NAN);
        self.warnings.extend(seen.map(|warning| format!("{}{warning}", recording.before())));
    }

    /// Takes a filter's estimate of a row, and asks whether a long hold was a rest.
    pub fn see_rest(&mut self, recording: &Recording, estimate: &Estimate) {
        let quiet = self.quiet.see(estimate);
        self.warnings.extend(quiet.map(|quiet| format!("{}{}", recording.before(), quiet.text(Interface::Python))));
    }
}
