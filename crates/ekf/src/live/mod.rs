//! A sensor's filter for long-term use: plausibility of readings, surprising readings and jumps, R₀ of the session, the learned
//! correction, and doubts that widen intervals. It is generic over the precision, so that a computer and a microcontroller run the
//! same code.

mod doubt;
mod estimator;
mod fault_watch;
mod filter;
mod flags;
mod innovations;
mod jumps;
mod learned;
mod memory;
mod parts;
mod protections;
mod rest_follow;
mod rest_watch;
mod sieve;
mod static_curve;
mod turn_watch;
mod unread;

pub use doubt::{DOUBT, DoubtNumbers, DoubtParts, Doubts};
pub use estimator::SensorEstimator;
pub use fault_watch::FaultWatch;
pub use filter::{KNOWN_BEYOND, LiveEstimate, LiveFilter, LiveRow, Measured, may_be_unstretched, reported};
pub use flags::{Flag, Flags};
pub use innovations::Innovations;
pub use jumps::{BESIDE_SHARE, Jumps, SURPRISING_NIS};
pub use learned::{Correct, Learned};
pub use memory::Memory;
pub use parts::LiveParts;
pub use protections::Protections;
pub use rest_follow::{FARTHEST_REST, RestBounds, RestFollower, SessionStart};
pub use rest_watch::{RestSeen, RestWatch};
pub use sieve::{MOST_CODE_REPEATS, MOST_REPEATS, Repeats, Sieve, news};
pub use static_curve::StaticCurve;
pub use turn_watch::{TurnSeen, TurnWatch};
pub use unread::{NEVER_READ_S, Unread};
