//! The resistance of a soft, stretchable strain sensor as a state-space model.
//!
//! The default law is the *switched Kelvin-Voigt* law ([`SensorLaw`]): a quasi-static gauge curve, a dash-pot term and
//! relaxing branches whose gains differ between stretching and releasing. [`SwitchedModel`] joins it with a prior on
//! how the body moves ([`Motion`]) and with drift ([`ModelNoise`]), and gives the transition, process noise and
//! measurement gradient that a Kalman-type filter needs.
//!
//! # Policy
//! - `no_std`, no heap, no unsafe code, no panic: constructors validate and return [`ParameterError`]; evaluation of a
//!   validated model on finite input is finite.
//! - Generic over [`Scalar`]: `f32`, `f64`, and dual numbers where exact gradients are wanted.
//! - Units are in the names: `_s` seconds, `_ohm` ohms, `_rad` radians, `_mm` millimetres; strains and relative
//!   changes of resistance are dimensionless.
//!
//! # Features
//! Both off by default, both without std.
//! - `serde`: laws, noise, packed matrices, phases and converter results as plain data. Deserialising checks nothing,
//!   because the constructor of the model does. [`Motion`], [`Joint`] and front ends are left out: their constructors
//!   validate, and the infinite deviation that a motion may have does not survive JSON. Store the arguments of their
//!   constructors. [`ParameterError`] borrows a static name and cannot be deserialised.
//! - `defmt`: `Format` for the same, and for errors.
#![no_std]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod drive;
mod error;
mod front_end;
mod gauge;
mod joint;
mod law;
mod motion;
mod noise;
mod phase;
mod response;
mod reversal;
mod scalar;
mod sizes;
mod switched;
mod symmetric;

pub use error::{ParameterError, Problem};
pub use front_end::{AdcCode, ConstantCurrent, Divider, FrontEnd, Ohms, SensorSide};
pub use gauge::Gauge;
pub use joint::Joint;
pub use law::{Branch, SensorLaw, StrainRange};
pub use motion::{MOTION_STATES, Motion};
pub use noise::ModelNoise;
pub use phase::{Direction, Phase, SplitRate, Turning, UNEXPLAINED, UNEXPLAINED_SHAPE, unexplained};
pub use response::Response;
pub use reversal::{LEAST_LEFT, RateChange, TURNING, TurningNumbers, correlated_steps};
pub use scalar::{Number, Scalar};
pub use sizes::{Branches, Models, WithBaseline, WithoutBaseline};
pub use switched::{Observation, SwitchedModel, SwitchedStep, Transition};
pub use symmetric::Symmetric;
