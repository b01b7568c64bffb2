//! Kalman-type filters and smoothers for a scalar reading of a hidden state.
//!
//! Configuration and state are separate: an estimator ([`Ekf`]) holds the model, takes a [`Belief`], and returns a
//! [`Step`] with a new belief. An error leaves the caller's belief unchanged, and one estimator serves many sensors.
//!
//! [`Ekf`] keeps one Gaussian and has a smoother. [`Imm`], [`SignSplit`] and
//! [`Hypotheses`] keep a [`Mixture`] of hypotheses about the phase, because the readings of stretching and releasing
//! can look alike. [`correction`] improves a calibrated filter's strain with a correction learned in calibration.
//!
//! For a model of your own, [`kalman`] has linear, extended and unscented filters, smoothers and maximum likelihood.
//!
//! Models are types that implement [`Dynamics`] and [`Channel`];
//! [`SwitchedModel`](ohmstrain_model::SwitchedModel) does.
//!
//! # Policy
//! - `no_std`, no heap, no unsafe code, no panic.
//! - A missing reading is a prediction. A step of zero seconds is an update without a prediction. A NaN or infinite
//!   reading, a negative step and an innovation variance that is not positive are [`StepError`]s.
//! - All computed values are returned: prior, innovation, its variance, log-likelihood, gain.
//! - Covariances are stored as packed triangles, so they are symmetric by construction. They are updated in Joseph's form,
//!   except in filters on the kernel, whose docs say so.
//!
//! # Features
//! `dual` computes Jacobians of a model in [`kalman`]. `simd` steps four hypotheses at once on processors with AVX2, or in
//! WebAssembly with vectors. `adskalman` passes linearised steps to that crate. All features are off by default. The following
//! work without std:
//! - `serde`: [`Belief`], [`Estimate`], [`Gaussian`], readings, innovations, verdicts of readings and errors as plain data;
//!   and [`live::Memory`], the whole state of a running filter. A mixture in it is first made a list of numbers, by
//!   [`live::Memory::try_map`] and [`PlainState`]. A deserialised belief is not checked; a step that is impossible from it is
//!   rejected. Types whose constructors validate are left out.
//! - `defmt`: `Format` for beliefs and related types, but not for mixtures. The target sends only numbers, no text.
//!
//! ```
//! use ohmstrain_ekf::{Ekf, Reading, Start};
//! use ohmstrain_model::*;
//! # let law = SensorLaw {
//! #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
//! #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01,
//! #     branches: [Branch {
//! #         tau_s: 20.0, extend_gain: 0.6, retract_gain: -0.4, extend_gain_slope: 0.0, retract_gain_slope: 0.0,
//! #     }],
//! #     range: StrainRange { lower: 0.0, upper: 0.33 },
//! # };
//! # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
//! # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
//! let model = WithBaseline::<f64, 1>::new(law, motion, noise)?;
//! let ekf = Ekf::new(model);
//! let mut belief = model.start();
//! for rho in [0.01, 0.03, 0.06] {
//!     let step = ekf.step(&belief, 0.05, Some(Reading::from(rho)))?;
//!     belief = step.posterior;
//! }
//! assert!(belief.mean[0] > 0.0 && belief.covariance[(0, 0)] > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "adskalman")]
mod adskalman_bridge;
mod belief;
mod clock;
pub mod correction;
mod ekf;
mod error;
mod estimate;
mod estimator;
mod guard;
pub mod kalman;
mod kernel;
pub mod live;
mod mixture;
mod plain;
#[cfg(feature = "record")]
pub mod record;
mod residual;
mod smooth;
mod sparse;
mod substeps;
mod traits;

#[cfg(feature = "adskalman")]
pub use adskalman_bridge::LinearStep;
pub use belief::{Belief, BeliefOf, Gaussian, Start};
pub use clock::seconds_between;
pub use ekf::{Ekf, Step, Update};
pub use error::StepError;
pub use estimate::{Estimate, Settling};
pub use estimator::{Advanced, Estimator, Innovation, State};
pub use guard::{Guard, Guarded, Influence, ReadingVerdict, Streak};
pub use kernel::{
    AnyCurve, Compact, CompactWidth, Cubic, Curve, CurveLine, Lanes, Logistic, Real, Recordable, SigmaPoints,
    SparseEkf, Switch,
};
pub use mixture::{Dwell, Evidence, Hypotheses, Imm, Mixture, MixtureResidual, PhaseMixture, Share, SignSplit};
pub use plain::PlainState;
pub use residual::Residual;
pub use smooth::{PastStep, rts_step, smooth_back_through};
pub use substeps::{
    EVENLY as STEP_EVENLY, GRACE as STEP_GRACE, GROWTH as STEP_GROWTH, LONGEST_PAUSE_S, Pause, Repeated, Substeps,
};
pub use traits::{Channel, Dynamics, Reading};
