//! The sign-split filter of the sensor's own model at a fixed rate.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it as it was, and nothing takes a
//! logarithm unless asked or unless the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel, Turning};

use crate::belief::gaussian::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::Added;
use crate::mixture::children::Children;
use crate::mixture::evidence::{Newborn, Weighing};
use crate::mixture::genealogy::{Heirs, sparse_steps};
use crate::mixture::pause::Pause;
use crate::mixture::sign_split::{HOPELESS, follows, goes_on, toward};
use crate::mixture::sparse::{Share, SparseMixture};
use crate::mixture::step::{LEAST_MASS, Predicted};
use crate::mixture::switching::{forgets_direction_s, fresh_rate};
use crate::{
    AnyCurve, Curve, Dwell, Evidence, Gaussian, Logistic, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// [`SignSplit`](crate::SignSplit) of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length: the
/// same to rounding, without multiplying zeros. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseSignSplit<T, const B: usize, const N: usize, const K: usize, S = Logistic, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    /// Probabilities of a change of phase over a step, `[from][to]`; `None` for a body that never rests.
    pub(crate) chain: Option<[[T; 3]; 3]>,
    pub(crate) weighing: Weighing<T>,
    /// Rate of a moving phase after a hold.
    pub(crate) fresh: [Gaussian<T>; 3],
    /// Seconds without a reading after which a step leaves the direction open.
    pub(crate) forgets_direction_s: T,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> SparseSignSplit<T, B, N, K> {
    /// A filter for steps of `dt_s` seconds.
    /// - `hold`: how long holds and movements last; `None` for a body that never rests.
    /// - `evidence`: what weighs the hypotheses.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number.
    pub fn new(
        model: SwitchedModel<T, B, N>,
        dt_s: T,
        hold: Option<Dwell<T>>,
        evidence: Evidence<T>,
    ) -> Result<Self, StepError> {
        Ok(Self::around(SparseEkf::new(model, dt_s)?, hold, evidence))
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>>
    SparseSignSplit<T, B, N, K, S, G>
{
    /// A filter whose hypotheses step as `kernel` does; the other arguments as for [`Self::new`]. Of its switch only the
    /// square root is used but in a pause, where the direction stays open.
    pub fn around(kernel: SparseEkf<T, S, B, N, G>, hold: Option<Dwell<T>>, evidence: Evidence<T>) -> Self {
        Self {
            chain: hold.map(|dwell| dwell.probabilities(kernel.dt_s())),
            weighing: Weighing::new(evidence),
            fresh: Phase::ALL.map(|phase| fresh_rate(kernel.model().motion(), phase)),
            forgets_direction_s: forgets_direction_s(kernel.model()),
            kernel,
        }
    }

    /// The model.
    pub const fn model(&self) -> &SwitchedModel<T, B, N> {
        self.kernel.model()
    }

    sparse_steps!(SignSplit);

    #[inline(always)]
    fn step_recorded<const L: usize>(
        &self,
        state: &SparseMixture<T, N, L, K>,
        reading: Option<Reading<T>>,
        next: &mut SparseMixture<T, N, L, K>,
        heirs: &mut impl Heirs,
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
                    let origin = Origin { parent, from: *from, turning, phase, probability };
                    if let Some(added) = self.add_child(&origin, reading, &mut children, &mut predicted)? {
                        heirs.placed(place, phase, added);
                    }
                }
            }
        }
        let density = children.density();
        children.normalise(heirs)?;
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
    ) -> Result<Option<Added>, StepError> {
        let Origin { parent, from, turning, phase, probability } = *origin;
        let mut child = Parts::of(&parent.belief);
        let rests = self.chain.is_some() && from == Phase::Hold && phase != Phase::Hold;
        if rests {
            child.renew_rate(&self.fresh[phase.index()]);
        }
        if turning.is_some() && phase != Phase::Hold && self.is_hopeless(phase, &child) {
            return Ok(None);
        }
        let course = match turning {
            _ if rests || phase == Phase::Hold => Course::Known(phase),
            None => Course::Uncertain,
            Some(_) if from == Phase::Hold => Course::Known(phase),
            Some(turning) => Course::Within(phase, turning),
        };
        let spread = self.kernel.predict(&mut child, course);
        let mut prior = parent.weight * probability;
        if turning.is_some() && phase != Phase::Hold {
            let mass = child.cut_rate::<S, N>(phase, self.weighing.clear());
            if !(mass > T::of(LEAST_MASS)) {
                return Ok(None);
            }
            // After a hold the chain has said how likely this direction is; none of it goes to the other.
            if !(rests && mass > T::of(0.5)) {
                prior *= mass;
            }
        }
        let newborn = Newborn { phase, prior, spread, per_inside: parent.per_inside };
        let weighed = self.kernel.weigh(&mut child, newborn, reading, &self.weighing, predicted)?;
        Ok(Some(children.add(&child, phase, &weighed)))
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
    parent: &'a Share<T, N, L>,
    from: Phase,
    /// What its rate leaves open over the step, unless it rests; `None` if a reading is missing to tell its direction.
    turning: Option<Turning<T>>,
    phase: Phase,
    /// Probability that the parent has this child.
    probability: T,
}
