//! A plan, the trace that it makes of files, and what the trace is like.

mod build;
mod plan;
mod survey;
mod survey_lines;

pub use build::Imported;
pub use plan::Plan;
pub use survey::{Allan, ChannelSurvey, ClockSurvey, PhaseSurvey, Survey};
