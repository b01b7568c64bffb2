//! Closed-form laws of the source paper, and of its field, fitted to single phases of a recording.
//!
//! A filter needs a law that holds over a whole session. These hold over one stretch, one hold or one release, and are the ones that
//! publications report. [`ClosedForm`] names them, [`fit_closed_form`] fits them without a manual start.
//!
//! # Policy
//! - Every law is a weighted sum of functions that have few parameters of their own ([`SeparableLaw`]). The weights are eliminated, so the
//!   search is only over time constants and similar parameters.
//! - A parameter that the data do not determine has no standard error (`None`) instead of an enormous or a tiny one.
//! - Standard errors assume white residuals. [`ClosedFormFit::residual_autocorrelation`] measures the deviation from that.

mod catalogue;
mod datum;
mod exponentials;
mod fit;
mod law;
mod moving;
mod moving_hold;
mod pieces;
mod projection;
mod search;
mod statistics;
mod stretched;
mod tunnelling;

pub use catalogue::ClosedForm;
pub use datum::{Datum, Moment, Movement};
pub use exponentials::ModulusShape;
pub use fit::fit_closed_form;
pub use law::{ClosedFormError, Derived, Parameter, SeparableLaw, Unit, value_and_gradient};
pub use pieces::{hold_data, moving_data, whole_data};
pub use search::{Extent, Search};
pub use statistics::{ClosedFormFit, Estimated};
