//! The library as its users see it. One test program; a module for each subject.

mod another_day;
mod calibration_doubts;
mod doubts;
mod empty_rows;
mod fused;
mod known;
mod lag;
mod motion_doubts;
mod resumed;
mod rows;
mod static_curve;
mod surprises;
mod threads;
#[cfg(feature = "trace")]
mod watched;
