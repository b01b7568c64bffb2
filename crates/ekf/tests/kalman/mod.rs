//! `kalman` beside other formulations and published numbers.

mod dense;
mod diffuse;
#[cfg(feature = "dual")]
mod dual;
mod errors;
mod examples;
mod linear;
mod nonlinear;
mod sensor;
