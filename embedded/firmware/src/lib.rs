//! Converter code → ohm → filter → strain, as on a microcontroller.
//!
//! The filters are generic over the scalar: `f32` on the target, `f64` on the host, which computes the reference. Each program
//! in `src/bin` runs one of them over the same recorded codes and reports its cost.
#![no_std]

mod codes;
mod filters;
mod fpu;
#[cfg(target_os = "none")]
pub mod frame;
mod sensors;

pub use codes::{CODES_3, CODES_6};
pub use filters::{
    Ekf3, Ekf6, Fast, Fast3, Fast6, FastImm6, FastSplit6, Filter, PreparedEkf, VaryingEkf3, VaryingFast3,
};
pub use fpu::OnFpu;
pub use sensors::{DT_S, REST_OHM, front_end, limits, sensor, to_reading};
