//! Part of the Python package `ohmstrain` that is written in Rust: tables, sensors and filters.
//!
//! Tables are exchanged through the Arrow C data interface. The interpreter's lock is released during computations. Arguments
//! are documented in the Python sources, `ohmstrain/__init__.py` and `_sensor.py`, where users look.

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
    use super::calibration::{calibrate, check_choices, check_prior, evaluate_split, fit_prior};
    #[pymodule_export]
    use super::error::OhmstrainError;
    #[pymodule_export]
    use super::fused::{FusedFilter, FusedSensor, read_hand};
    #[pymodule_export]
    use super::live::{LaggedFilter, LiveFilter};
    #[pymodule_export]
    use super::read::read;
    #[pymodule_export]
    use super::sensor::Sensor;

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let error = module.py().get_type::<OhmstrainError>();
        // Of errors that Python raises.
        for place in ["file", "row", "column"] {
            error.setattr(place, module.py().None())?;
        }
        module.add("MADE_BY", ohmstrain::MADE_BY)
    }
}
