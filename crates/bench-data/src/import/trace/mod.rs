//! A plan, the trace that it makes from files, and a survey of the trace.

mod build;
mod each;
mod mentions;
mod plan;
mod recordings;
mod survey;
mod survey_lines;

pub use build::Imported;
pub use each::{EachPlan, EachTrace};
pub use plan::Plan;
pub use survey::{Allan, ChannelSurvey, ClockSurvey, PhaseSurvey, Survey};
