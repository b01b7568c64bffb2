//! The part of the Python package `ohmstrain` that is written in Rust: tables in, tables out, sensors and filters.
//!
//! Tables come and go through the Arrow C data interface. The interpreter's lock is released while anything is computed.
//! What the arguments mean is documented where Python users look: in `ohmstrain/__init__.py` and `sensor.py`.

mod about;
mod calibration;
mod doubts;
mod error;
mod evaluation;
mod firmware;
mod fused;
mod live;
mod options;
mod read;
mod recording;
mod sensor;
mod table;
mod watch;

use pyo3::prelude::*;

/// The module `ohmstrain._core`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::calibration::{calibrate, check_prior, evaluate_split, fit_prior};
    #[pymodule_export]
    use super::error::OhmstrainError;
    #[pymodule_export]
    use super::fused::{FusedFilter, FusedSensor};
    #[pymodule_export]
    use super::live::{LaggedFilter, LiveFilter};
    #[pymodule_export]
    use super::read::read;
    #[pymodule_export]
    use super::sensor::Sensor;

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("MADE_BY", ohmstrain::MADE_BY)
    }
}
