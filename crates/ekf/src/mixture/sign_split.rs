use ohmstrain_model::{Phase, StrainRange};

use crate::belief::gaussian::Real;
use crate::mixture::lineage::{Lineage, Recorder};
use crate::mixture::pause::Pause;
use crate::mixture::step::{Candidates, Course, Evidence, MixtureStep, Origin, mixture_estimator, smooth_step};
use crate::mixture::{Mixture, keep_rate_in};
use crate::{Dwell, Gaussian, Phased, Reading, StepError};

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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignSplit<T, M, const K: usize> {
    model: M,
    hold: Option<Dwell<T>>,
    evidence: Evidence<T>,
}

impl<T: Real, M, const K: usize> SignSplit<T, M, K> {
    /// - `hold`: how long holds and movements last; `None` for a body that never rests.
    /// - `evidence`: what weighs the hypotheses.
    pub const fn new(model: M, hold: Option<Dwell<T>>, evidence: Evidence<T>) -> Self {
        Self { model, hold, evidence }
    }

    /// The model.
    pub const fn model(&self) -> &M {
        &self.model
    }

    fn longest_s<const N: usize, const L: usize>(&self) -> T
    where
        M: Phased<T, N, L>,
    {
        self.model.longest_step_s()
    }

    /// Predicts over a prepared step of `dt_s ≥ 0` seconds, then takes the reading.
    ///
    /// # Errors
    /// See [`StepError`]; the mixture passed in is untouched.
    pub fn step_prepared<const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, K>,
        prepared: &M::Prepared,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<MixtureStep<T, N, L, K>, StepError>
    where
        M: Phased<T, N, L>,
    {
        self.step_recorded(mixture, &(*prepared, dt_s), reading, &mut ())
    }

    pub(crate) fn step_recorded<R: Recorder<T, N, L>, const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, K>,
        (prepared, dt_s): &(M::Prepared, T),
        reading: Option<Reading<T>>,
        recorder: &mut R,
    ) -> Result<MixtureStep<T, N, L, K>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading, recorder);
        let chain = self.hold.map(|dwell| dwell.probabilities(*dt_s));
        let pause = match reading {
            None => mixture.pause().goes_on(*dt_s, self.model.forgets_direction_s()),
            Some(_) => Pause::over(),
        };
        let open = pause.open;
        for parent in mixture.components().iter().enumerate() {
            let follows = if open { goes_on } else { follows };
            for (phase, probability) in Phase::ALL.into_iter().zip(follows(chain.as_ref(), parent.1.phase)) {
                // A body without a hold phase goes on moving, whatever it was called before.
                let rests = self.hold.is_some() && parent.1.phase == Phase::Hold && phase != Phase::Hold;
                let from = &if rests { self.model.enter(&parent.1.belief, phase) } else { parent.1.belief };
                let hopeless = |rate: Gaussian<T>| {
                    let toward = if phase == Phase::Retract { -rate.mean } else { rate.mean };
                    toward < -T::of(HOPELESS) * rate.sd()
                };
                if !open && phase != Phase::Hold && self.model.rate_ahead(prepared, from, phase).is_some_and(hopeless) {
                    continue;
                }
                let before = if mixture.pause().open { toward(parent.1.phase, &from.mean[1]) } else { parent.1.phase };
                let course = match phase {
                    _ if rests => Course::Known,
                    Phase::Extend | Phase::Retract if open => Course::Open,
                    _ => Course::After(before),
                };
                let origin = Origin { parent, from, begins: rests, course, phase, probability };
                candidates.add(&origin, prepared, |prior| match rates_of(phase) {
                    Some(rates) if !open => {
                        let mass = keep_rate_in(prior, &rates);
                        // After a hold the chain has said how likely this direction is; none of it goes to the other.
                        if rests && mass > T::of(0.5) { T::one() } else { mass }
                    }
                    _ => T::one(),
                })?;
            }
        }
        let mut step = candidates.finish()?;
        step.posterior.set_pause(pause);
        Ok(step)
    }

    smooth_step!();
}

/// Deviations of the rate beyond zero at which less than a thousandth of the prediction is left, too little to follow.
pub(crate) const HOPELESS: f64 = 3.090_232_306_167_813_5;

/// Probabilities of the phases that follow `phase`, in the order of [`Phase::ALL`]. Whether a moving body stretches or
/// releases is for the cut to say.
pub(crate) fn follows<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    match (chain, phase) {
        (None, _) => [T::one(), T::zero(), T::one()],
        (Some(chain), Phase::Hold) => chain[1],
        (Some(chain), _) => [T::one() - chain[0][1], chain[0][1], T::one() - chain[0][1]],
    }
}

/// The same where the direction stays open: a movement goes on as one, until a reading splits it.
pub(crate) fn goes_on<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    let (stops, zero) = (chain.map_or(T::zero(), |chain| chain[0][1]), T::zero());
    match (chain, phase) {
        (Some(chain), Phase::Hold) => chain[1],
        (_, Phase::Retract) => [zero, stops, T::one() - stops],
        _ => [T::one() - stops, stops, zero],
    }
}

/// The phase of a rate that was left open; what holds has none.
pub(crate) fn toward<T: Real>(phase: Phase, rate: &T) -> Phase {
    match phase {
        Phase::Hold => Phase::Hold,
        _ if *rate < T::zero() => Phase::Retract,
        _ => Phase::Extend,
    }
}

/// The rates that belong to a moving phase.
fn rates_of<T: Real>(phase: Phase) -> Option<StrainRange<T>> {
    let (zero, infinite) = (T::zero(), T::one() / T::zero());
    match phase {
        Phase::Extend => Some(StrainRange { lower: zero, upper: infinite }),
        Phase::Hold => None,
        Phase::Retract => Some(StrainRange { lower: -infinite, upper: zero }),
    }
}

mixture_estimator!(SignSplit<T, M, K>, K);
