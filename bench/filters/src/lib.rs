//! Measured filters of ohmstrain: its estimators at a fixed rate, each with its state, one reading at a time; and a
//! hand-written filter without checks for comparison.

mod correction;
mod estimators;
mod mixtures;
mod nonlinear;
mod readings;
mod recordings;
mod reference;
mod sensor;
mod sparse;

pub use correction::Corrected;
pub use estimators::{Gated, STEPS, ekf, every_filter};
pub use nonlinear::{Ahead, Expected, NonlinearModel};
pub use readings::{readings, strain_at};
pub use recordings::{Smoother, smoother};
pub use reference::{NonlinearReference, PackedReference};
pub use sensor::{DT_S, LinearModel, RANGE, linear_sensor, linearised, phased_sensor, sensor, sensor_of};
pub use sparse::{GatedSparse, GatedUnscented};

/// A filter with its state.
pub trait Filter {
    /// Takes the next reading; returns true if the step succeeded.
    fn step(&mut self, reading: f64) -> bool;

    /// Returns the mean strain.
    fn strain(&self) -> f64;
}

/// Visitor of filters of many types.
pub trait Visitor {
    /// Takes a filter before its first reading, and its readings.
    fn visit(&mut self, name: &'static str, readings: &[f64], filter: impl Filter);
}
