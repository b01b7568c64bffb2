//! Looking back: smoothers, and windows of past steps.

mod back;
mod in_place;
mod rts;
mod window;

pub use back::{PastStep, smooth_back_through};
#[cfg(feature = "std")]
pub use rts::rts_smooth_vec;
pub use rts::{rts_smooth, rts_step};
pub use window::Window;
