//! Smoothers.

mod back;
mod rts;

pub use back::{PastStep, smooth_back_through};
pub use rts::rts_step;
