//! The sensor's step: predict, cut, renew, compare, update. It stands here once, for numbers and for vectors of them.
//!
//! # Policy
//! - A [`Lanes`] is a number or a vector. Where lanes may go different ways, all ways that some lane goes are computed and the
//!   results chosen; where the mask is a `bool`, that is a branch.
//! - Everything is `#[inline(always)]`, and loops run over constant sizes: code in closures that is not inlined would not use the
//!   vector instructions of its caller.
//! - Multiplications and additions are rounded one by one, in the order in which they are written; vectors fuse them where the
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
