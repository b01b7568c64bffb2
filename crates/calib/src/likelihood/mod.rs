//! Maximum likelihood on the readings alone, for recordings without a measured strain.
//!
//! [`Likelihood`] joins a family of models ([`ModelFamily`]), parameters and recordings. It gives the log-likelihood of the Kalman filter's
//! innovations with exact gradient and Hessian on the logarithms of the parameters (hyper-dual numbers run through the same filter), the
//! maximum, standard errors and profile intervals. [`LikelihoodProblem`] does the same for a sensor with a known law.
//!
//! The likelihood relies on the model. If the law is wrong by more than its noise allows for, the filter becomes overconfident, which
//! readings alone do not show. If a reference exists, [`calibrate`](crate::calibrate) is better.
//!
//! # Policy
//! - Parameters are positive and bounded; one that ends on a bound is reported as such and has no standard error.
//! - NaN is a missing reading; an infinite one, or time that runs backwards, is an error that names the time.
//! - Deterministic; the cost of a Hessian is P (P + 1)/2 filter runs in hyper-dual numbers.

mod derivatives;
mod family;
mod fit;
mod log_likelihood;
mod newton;
mod problem;
mod profile;
mod sensor;
mod sensor_family;

pub use derivatives::Derivatives;
pub use family::{ModelFamily, Parameter};
pub use fit::{Bound, FittedParameter, Likelihood, LikelihoodFit};
pub use log_likelihood::{ReadingSeries, ReadingsLikelihood};
pub use problem::LikelihoodProblem;
pub use profile::ProfileInterval;
pub use sensor::{NoiseFit, NoiseStart};
pub use sensor_family::NoiseParameter;
