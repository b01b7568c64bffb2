use super::{Doubts, FaultWatch, Jumps, LiveParts, Protections, Repeats, RestFollower};
use crate::correction::ReadingFeatures;
use crate::{Pause, Real, Streak};

/// State of a filter at a row.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(deserialize = "T: Real + serde::Deserialize<'de>, S: serde::Deserialize<'de>"))
)]
pub(super) struct Moment<T, S> {
    /// State at the last used reading, or after whole steps of the pause that follows; `pause` is the time since then.
    pub(super) state: S,
    pub(super) pause: Pause<T>,
    pub(super) streak: Streak,
    pub(super) repeats: Repeats<T>,
    pub(super) jumps: Jumps<T>,
    pub(super) faults: FaultWatch<T>,
    /// Features of the readings, if there is a correction.
    pub(super) watched: Option<ReadingFeatures<T>>,
    /// The filter's variance at the last reading included in the features.
    pub(super) known_variance: T,
    pub(super) doubts: Doubts<T>,
    /// Follower of R₀; `None` if R₀ is given, or following is off.
    pub(super) follower: Option<RestFollower<T>>,
}

impl<T: Real, S> Moment<T, S> {
    /// Starts before any row, with a state and a pause of no length.
    pub(super) fn new<C>(parts: &LiveParts<T, C>, protections: Protections, (state, pause): (S, Pause<T>)) -> Self {
        let doubts = Doubts::new(parts.doubt);
        Self {
            state,
            pause,
            streak: Streak::default(),
            repeats: Repeats::none(),
            jumps: Jumps::none(),
            faults: FaultWatch::new(),
            watched: parts.learned.as_ref().map(|(scale, _)| ReadingFeatures::new(*scale)),
            known_variance: T::zero(),
            doubts: if parts.learned.is_some() { doubts.of_corrected() } else { doubts },
            follower: protections.following.then(|| RestFollower::new(parts.rest)),
        }
    }
}

impl<T, S> Moment<T, S> {
    fn try_map<R, E>(self, convert: impl FnOnce(S) -> Result<R, E>) -> Result<Moment<T, R>, E> {
        let Self { state, pause, streak, repeats, jumps, faults, watched, known_variance, doubts, follower } = self;
        let state = convert(state)?;
        Ok(Moment { state, pause, streak, repeats, jumps, faults, watched, known_variance, doubts, follower })
    }
}

/// State of a [`LiveFilter`](super::LiveFilter) between steps.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(deserialize = "T: Real + serde::Deserialize<'de>, S: serde::Deserialize<'de>"))
)]
pub struct Memory<T, S> {
    pub(super) now: Moment<T, S>,
    /// The state kept for the end of a fault.
    pub(super) kept: Moment<T, S>,
}

impl<T, S> Memory<T, S> {
    /// Converts the states.
    ///
    /// # Errors
    /// The error of the conversion.
    pub fn try_map<R, E>(self, mut convert: impl FnMut(S) -> Result<R, E>) -> Result<Memory<T, R>, E> {
        Ok(Memory { now: self.now.try_map(&mut convert)?, kept: self.kept.try_map(&mut convert)? })
    }
}
