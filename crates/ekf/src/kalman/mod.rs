//! Kalman filters for any model: linear, extended, unscented and iterated, with smoothers, delayed readings and maximum
//! likelihood.
//!
//! ```text
//! x′ = f(x) + w,  w ~ N(0, Q)      N states
//! y  = h(x) + v,  v ~ N(0, R)      M readings at once
//!
//! predict   x⁻ = f(x)              P⁻ = F P Fᵀ + Q            F = ∂f/∂x
//! update    ν  = y − h(x⁻)         S  = H P⁻ Hᵀ + R           H = ∂h/∂x
//!           K  = P⁻ Hᵀ S⁻¹         x  = x⁻ + K ν              P = (I − K H) P⁻
//! smooth    G  = P Fᵀ P′⁻⁻¹        xˢ = x + G (x′ˢ − x′⁻)      Pˢ = P + G (P′ˢ − P′⁻) Gᵀ
//! ```
//!
//! | filter | model | f and h become |
//! |---|---|---|
//! | [`Kalman`] | F, Q, H, R and B u | themselves |
//! | [`Ekf`] | `(f, F, h, H)`, or a type that is [`Differentiable`] | tangents at the mean |
//! | [`Ukf`] | `(f, h)`, or a type that is a [`Model`] | regressions over sigma points |
//!
//! A constant velocity, read with gaps:
//!
//! ```
//! use nalgebra::{matrix, vector};
//! use ohmstrain_ekf::kalman::{Filter, Kalman, Normal, smooth};
//!
//! let (f, q) = (matrix![1.0, 0.1; 0.0, 1.0], matrix![0.0, 0.0; 0.0, 1e-3]);
//! let (h, r) = (matrix![1.0, 0.0], matrix![0.01]);
//! let kalman = Kalman::new(f, q, h, r);
//!
//! let mut state = Normal::independent(vector![0.0, 0.0], &vector![1e7, 1.0])?;
//! let mut steps = vec![];
//! for reading in [Some(0.11), None, Some(0.33), Some(0.38)] {
//!     let step = kalman.step(&state, &[reading])?;
//!     state = step.posterior;
//!     steps.push(step);
//! }
//! let mut smoothed = vec![state; steps.len()];
//! smooth(&steps, &mut smoothed)?;
//! assert!(smoothed[0].sd()[1] < steps[0].posterior.sd()[1]);
//! # Ok::<(), ohmstrain_ekf::kalman::KalmanError>(())
//! ```
//!
//! - **What changes from step to step** (its length, a control input, Q, R) gives the next step another filter. Filters
//!   are values of a few matrices; states are passed in and returned.
//! - **Missing entries** of a reading are `None`; the others are used, even with correlated noise. If all entries are
//!   `None`, the step is a prediction.
//! - **The first reading** is an [`update`](Filter::update) if the start is the state at that time, and a
//!   [`step`](Filter::step) if it is the state one step earlier.
//! - **Fitting**: [`maximise`] maximises the sum of [`Step::log_likelihood`], and returns standard errors.
//! - **Late readings**: [`Rewind`].
//!
//! `examples/` has six programs of at most forty lines for users' models: `constant_velocity`, `pendulum`, `nile`, `two_rates`,
//! `late_reading` and `noise_of_a_model`; `docs/kalman.md` in the repository compares four of them with other
//! libraries.
//!
//! # Policy
//! - `no_std`, no heap, no unsafe code, no panic; `f32`, `f64` and dual numbers. Matrices are plain N × N and meant for
//!   N and M up to 8; a step takes about N³ + N² M operations, and holds about ten N × N matrices on the stack.
//! - An error leaves the caller's state unchanged. Numbers that are not finite are errors.
//! - P is stored as L D Lᵀ and never subtracted, so it stays symmetric and positive semi-definite, and a start with P = 1e7
//!   costs no digits in `f32`. If a reading is so exact compared with the prior that digits would be lost, the update is
//!   rejected: [`KalmanError::LostPrecision`].
//! - Exactly known states, singular Q and exact readings are valid input.
//!
//! Sources: Särkkä, *Bayesian Filtering and Smoothing* (2013), chapters 4, 5 and 8; Bar-Shalom, Li & Kirubarajan,
//! *Estimation with Applications to Tracking and Navigation* (2001), chapter 7; Bierman, *Factorization Methods for
//! Discrete Sequential Estimation* (1977); Durbin & Koopman, *Time Series Analysis by State Space Methods* (2012).

#[cfg(feature = "dual")]
mod dual;
mod ekf;
mod error;
mod factor;
mod filter;
mod linear;
mod maximise;
mod model;
mod normal;
mod rewind;
mod rows;
mod smooth;
mod ukf;

#[cfg(feature = "dual")]
pub use dual::ByDual;
pub use ekf::Ekf;
pub use error::KalmanError;
pub use filter::{Affine, Filter, Prediction, Step};
pub use linear::Kalman;
pub use maximise::{Maximum, NoMaximum, maximise};
pub use model::{Differentiable, Model};
pub use normal::Normal;
pub use rewind::Rewind;
pub use smooth::{smooth, smooth_first};
pub use ukf::Ukf;
