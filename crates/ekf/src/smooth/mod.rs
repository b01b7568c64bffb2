//! Looking back: smoothers.

mod back;
mod in_place;
mod rts;

pub use back::{PastStep, smooth_back_through};
#[cfg(feature = "std")]
pub use rts::rts_smooth_vec;
pub use rts::{rts_smooth, rts_step};
