//! The sign-split filter.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it as it was, and nothing takes a
//! logarithm unless asked or unless the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel, Turning};

use crate::belief::gaussian::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::children::Children;
use crate::mixture::estimator::{mixture_filter, mixture_steps};
use crate::mixture::evidence::{Newborn, Weighing};
use crate::mixture::lineage::{Birth, Following, Recorder};
use crate::mixture::pause::Pause;
use crate::mixture::predicted::Predicted;
use crate::mixture::state::{Mixture, Share};
use crate::mixture::switching::{forgets_direction_s, fresh_rate};
use crate::{
    AnyCurve, Curve, Dwell, Evidence, Gaussian, Logistic, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// At most `K` Gaussian hypotheses split by the sign of the rate.
///
/// Each predicted Gaussian is cut at rate zero. The masses of the halves are the probabilities of stretching and
/// releasing, and each half drives the branches with its own gains. With a [`Dwell`] there is a hold phase besides,
/// entered and left by the chain's probabilities; its moving phases turn around by crossing rate zero, not by the chain.
///
/// In a pause of the readings nothing is cut any more once the rate has forgotten its direction: a Gaussian whose tail is cut off
/// and merged with the other half at every row would forget it the sooner the more rows there are, and with it how far the body
/// may have gone. Each hypothesis then moves on with an uncertain direction, as that of an [`Ekf`](crate::Ekf), and the next
/// reading splits it.
///
/// A truncated Gaussian-sum split. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignSplit<T, const B: usize, const N: usize, const K: usize, S = Logistic, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    hold: Option<Dwell<T>>,
    /// Probabilities of a change of phase over a step, `[from][to]`; `None` for a body that never rests.
    pub(crate) chain: Option<[[T; 3]; 3]>,
    pub(crate) weighing: Weighing<T>,
    /// Rate of a moving phase after a hold.
    pub(crate) fresh: [Gaussian<T>; 3],
    /// Seconds without a reading after which a step leaves the direction open.
    pub(crate) forgets_direction_s: T,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> SignSplit<T, B, N, K> {
    /// A filter for steps of `dt_s` seconds.
    /// - `hold`: how long holds and movements last; `None` for a body that never rests.
    /// - `evidence`: what weighs the hypotheses.
    ///
    /// # Errors
    /// If `dt_s` is negative or not finite.
    pub fn new(
        model: SwitchedModel<T, B, N>,
        dt_s: T,
        hold: Option<Dwell<T>>,
        evidence: Evidence<T>,
    ) -> Result<Self, StepError> {
        Ok(Self::around(SparseEkf::of_any_length(model, dt_s)?, hold, evidence))
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> SignSplit<T, B, N, K, S, G> {
    /// A filter whose hypotheses step as `kernel` does; the other arguments as for [`Self::new`]. Of its switch only the
    /// square root is used but in a pause, where the direction stays open.
    pub fn around(kernel: SparseEkf<T, S, B, N, G>, hold: Option<Dwell<T>>, evidence: Evidence<T>) -> Self {
        Self {
            hold,
            chain: hold.map(|dwell| dwell.probabilities(kernel.dt_s())),
            weighing: Weighing::new(evidence),
            fresh: Phase::ALL.map(|phase| fresh_rate(kernel.model().motion(), phase)),
            forgets_direction_s: forgets_direction_s(kernel.model()),
            kernel,
        }
    }

    fn longest_s(&self) -> T {
        self.model().longest_step_s()
    }

    /// The same filter for steps of another length.
    fn every(&self, dt_s: T) -> Self {
        let mut other = *self;
        other.kernel.set_length(dt_s);
        other.chain = other.hold.map(|dwell| dwell.probabilities(dt_s));
        other
    }

    mixture_steps!();

    #[inline(always)]
    fn step_recorded<const L: usize>(
        &self,
        state: &Mixture<T, N, L, K>,
        reading: Option<Reading<T>>,
        next: &mut Mixture<T, N, L, K>,
        recorder: &mut impl Recorder<T, B>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        let pause = match reading {
            None => state.pause().goes_on(self.kernel.dt_s(), self.forgets_direction_s),
            Some(_) => Pause::over(),
        };
        let open = pause.open;
        let mut children = Children::new(next);
        let mut predicted = Predicted::new();
        for (place, (parent, from)) in state.shares().iter().zip(state.phases()).enumerate() {
            let before = if state.pause().open { toward(*from, &parent.belief.mean[1]) } else { *from };
            let turning = if open { None } else { Some(self.kernel.turning(before, &Parts::of(&parent.belief))) };
            let follows = if open { goes_on } else { follows };
            for (phase, probability) in Phase::ALL.into_iter().zip(follows(self.chain.as_ref(), *from)) {
                if probability > T::zero() {
                    let origin = Origin { place, parent, from: *from, turning, phase, probability };
                    self.add_child(&origin, reading, &mut children, &mut predicted, recorder)?;
                }
            }
        }
        let density = children.density();
        children.normalise(recorder)?;
        next.set_pause(pause);
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, self.weighing.tempering())))
    }

    #[inline(always)]
    fn add_child<const L: usize>(
        &self,
        origin: &Origin<'_, T, N, L>,
        reading: Option<Reading<T>>,
        children: &mut Children<'_, T, N, L, K>,
        predicted: &mut Predicted<T>,
        recorder: &mut impl Recorder<T, B>,
    ) -> Result<(), StepError> {
        let Origin { place, parent, from, turning, phase, probability } = *origin;
        let mut child = Parts::of(&parent.belief);
        let rests = self.chain.is_some() && from == Phase::Hold && phase != Phase::Hold;
        if rests {
            child.renew_rate(&self.fresh[phase.index()]);
        }
        if turning.is_some() && phase != Phase::Hold && self.is_hopeless(phase, &child) {
            return Ok(());
        }
        let course = match turning {
            _ if rests || phase == Phase::Hold => Course::Known(phase),
            None => Course::Uncertain,
            Some(_) if from == Phase::Hold => Course::Known(phase),
            Some(turning) => Course::Within(phase, turning),
        };
        let start = child;
        let spread = self.kernel.predict(&mut child, course);
        let prediction = child;
        let mut prior = parent.weight * probability;
        if turning.is_some() && phase != Phase::Hold {
            let mass = child.cut_rate::<S, N>(phase, self.weighing.clear());
            if !(mass > T::of(LEAST_MASS)) {
                return Ok(());
            }
            // After a hold the chain has said how likely this direction is; none of it goes to the other.
            if !(rests && mass > T::of(0.5)) {
                prior *= mass;
            }
        }
        let newborn = Newborn { phase, prior, spread, per_inside: parent.per_inside };
        let weighed = self.kernel.weigh(&mut child, newborn, reading, &self.weighing, predicted)?;
        let added = children.add(&child, phase, &weighed);
        let (from, predicted, posterior, weighed) = (&start, &prediction, &child, &weighed);
        let birth = Birth { parent: place, phase, from, begins: rests, course, predicted, posterior, weighed };
        recorder.born(&birth, added);
        Ok(())
    }

    /// Whether next to nothing of a prediction has the sign of a moving phase.
    #[inline(always)]
    fn is_hopeless(&self, phase: Phase, from: &Parts<T, B>) -> bool {
        let ahead = self.kernel.rate_ahead(phase, from);
        let toward = if phase == Phase::Retract { -ahead.mean } else { ahead.mean };
        toward < T::zero() && toward * toward > T::of(HOPELESS * HOPELESS) * ahead.variance
    }
}

/// What a child is made of.
struct Origin<'a, T, const N: usize, const L: usize> {
    /// Where its parent is.
    place: usize,
    parent: &'a Share<T, N, L>,
    from: Phase,
    /// What its rate leaves open over the step, unless it rests; `None` if a reading is missing to tell its direction.
    turning: Option<Turning<T>>,
    phase: Phase,
    /// Probability that the parent has this child.
    probability: T,
}

/// A cut that leaves less than this of a prediction is not followed: its moments would be those of a far tail.
pub(crate) const LEAST_MASS: f64 = 1e-3;
/// Deviations of the rate beyond zero at which less than a thousandth of the prediction is left, too little to follow.
pub(crate) const HOPELESS: f64 = 3.090_232_306_167_813_5;

/// Probabilities of the phases that follow `phase`, in the order of [`Phase::ALL`]. Whether a moving body stretches or
/// releases is for the cut to say.
fn follows<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    match (chain, phase) {
        (None, _) => [T::one(), T::zero(), T::one()],
        (Some(chain), Phase::Hold) => chain[1],
        (Some(chain), _) => [T::one() - chain[0][1], chain[0][1], T::one() - chain[0][1]],
    }
}

/// The same where the direction stays open: a movement goes on as one, until a reading splits it.
fn goes_on<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    let (stops, zero) = (chain.map_or(T::zero(), |chain| chain[0][1]), T::zero());
    match (chain, phase) {
        (Some(chain), Phase::Hold) => chain[1],
        (_, Phase::Retract) => [zero, stops, T::one() - stops],
        _ => [T::one() - stops, stops, zero],
    }
}

/// The phase of a rate that was left open; what holds has none.
fn toward<T: Real>(phase: Phase, rate: &T) -> Phase {
    match phase {
        Phase::Hold => Phase::Hold,
        _ if *rate < T::zero() => Phase::Retract,
        _ => Phase::Extend,
    }
}

mixture_filter!(SignSplit<B, N, K>, Mixture<K>);
