//! The sensor's step: predict, truncate, renew, compare, update. One source serves scalars and vectors.
//!
//! # Policy
//! - A [`Lanes`] is a scalar or a vector. If lanes take different branches, every branch taken by some lane is computed and
//!   the results are selected per lane. If the mask is a `bool`, that is an ordinary branch.
//! - Everything is `#[inline(always)]`, and loops run over constant sizes: code in closures that are not inlined would not use
//!   the vector instructions of its caller.
//! - Multiplications and additions are rounded one by one, in the order in which they are written; vectors fuse them if the
//!   processor can.

mod constants;
mod curve;
pub(crate) mod falls;
mod lanes;
mod parts;
mod predict;
mod rate;
mod several;
mod sparse;
mod switch;
pub(crate) mod tail;
mod transition;
mod update;

pub(crate) use constants::{Gains, StepConstants};
pub(crate) use curve::Regions;
pub use curve::{AnyCurve, Cubic, Curve, CurveLine, SigmaPoints};
pub(crate) use falls::Falls;
pub use lanes::Lanes;
#[cfg(feature = "simd")]
pub(crate) use lanes::Vector;
pub(crate) use parts::{Part, Parts};
pub(crate) use predict::Course;
pub(crate) use rate::side_of;
pub(crate) use several::{InVectors, MOST_LANES, Several, Work};
pub(crate) use sparse::MOST_TRIES;
pub use sparse::SparseEkf;
pub(crate) use switch::RateSpread;
pub use switch::{Compact, CompactWidth, Logistic, Switch};
pub use tail::{Real, Recordable};
pub(crate) use update::{ReadingLaw, refusal};
