//! The update with a reading, in place: `P - (P Hᵀ)(P Hᵀ)ᵀ/S`.

use ohmstrain_model::{Phase, Scalar, SplitRate, SwitchedModel};

use crate::sparse_parts::{Part, Parts};
use crate::switch::RateSpread;
use crate::{Curve, Reading, Residual, SparseEkf, StepError, Switch};

/// A reading beside its prediction.
#[derive(Clone, Copy)]
pub(crate) struct Compared<T, const B: usize> {
    /// Derivatives of the reading by strain and rate; those by branches and baseline are one.
    pub slope: T,
    pub viscosity: T,
    /// Covariances of the state with the reading.
    pub strain: T,
    pub rate: T,
    pub branches: [T; B],
    pub baseline: T,
    /// Variance S of the innovation.
    pub variance: T,
    pub innovation: T,
}

/// How the reading depends on the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReadingLaw<T, G> {
    pub curve: G,
    pub extend_viscosity_s: T,
    pub retract_viscosity_s: T,
    pub variance: T,
}

impl<T: Scalar, G: Curve<T>> ReadingLaw<T, G> {
    pub(crate) fn new<const B: usize, const N: usize>(model: &SwitchedModel<T, 2, B, N>) -> Option<Self> {
        let law = model.law();
        Some(Self {
            curve: G::new(&law.gauge, &law.range)?,
            extend_viscosity_s: law.extend_viscosity_s,
            retract_viscosity_s: law.retract_viscosity_s,
            variance: model.noise().reading_sd * model.noise().reading_sd,
        })
    }

    /// The expected reading of motion alone, its derivatives by strain and rate, and the variance of what an uncertain direction
    /// leaves of the dash-pot.
    #[inline(always)]
    fn of_motion<S: Switch<T>>(
        &self,
        strain: T,
        rate: T,
        phase: Option<Phase>,
        spread: &mut RateSpread<T, S>,
    ) -> (T, T, T, T) {
        let (gauge, slope) = self.curve.value_and_slope(strain);
        let (extend, retract) = (self.extend_viscosity_s, self.retract_viscosity_s);
        let viscosity = match phase {
            Some(Phase::Hold) => return (gauge, slope, T::zero(), T::zero()),
            Some(Phase::Extend) => extend,
            Some(Phase::Retract) => retract,
            None if rate * rate < RateSpread::<T, S>::clear() * spread.variance => {
                let split: SplitRate<T> = spread.blend(rate);
                let expected = gauge + extend * split.extend + retract * split.retract;
                let jump = extend - retract;
                return (expected, slope, split.slope(extend, retract), jump * jump * split.variance);
            }
            None if rate > T::zero() => extend,
            None => retract,
        };
        (gauge + viscosity * rate, slope, viscosity, T::zero())
    }
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Takes a reading. `phase` is a hypothesis, as for [`Channel::observe`](crate::Channel::observe); with `None` the rate
    /// is split by its variance, which is in `spread`. After an error `parts` means nothing.
    #[inline(always)]
    pub(crate) fn update(
        &self,
        parts: &mut Parts<T, B>,
        reading: Reading<T>,
        phase: Option<Phase>,
        spread: RateSpread<T, S>,
    ) -> Result<Residual<T>, StepError> {
        let Compared { strain, rate, branches, baseline, variance, innovation, .. } =
            self.compare(parts, reading, phase, spread);
        let per_variance = T::one() / variance;
        let scaled = innovation * per_variance;
        let nis = innovation * scaled;
        let (strain_gain, rate_gain) = (strain * per_variance, rate * per_variance);
        let take = |part: &mut Part<T, B>, own: T, others: usize| {
            let gain = own * per_variance;
            part.mean += own * scaled;
            part.with_strain -= gain * strain;
            part.with_rate -= gain * rate;
            for (with, other) in part.with.iter_mut().zip(&branches).take(others) {
                *with -= gain * *other;
            }
            part.variance -= gain * own;
        };
        parts.strain += strain * scaled;
        parts.rate += rate * scaled;
        parts.strain_variance -= strain_gain * strain;
        parts.strain_rate -= rate_gain * strain;
        parts.rate_variance -= rate_gain * rate;
        for i in 0..B {
            take(&mut parts.branches[i], branches[i], i);
        }
        if Self::HAS_BASELINE {
            take(&mut parts.baseline, baseline, B);
        }

        // S and ν²/S finite, S above zero: then everything before was finite. No variance below zero: then no gain can have
        // left the range of the numbers (Cauchy-Schwarz), and the means are all that is left to look at.
        if variance > T::zero() && !(reading.extra_variance < T::zero()) && parts.is_sound::<N>(variance + nis) {
            Ok(Residual { innovation, variance, nis })
        } else {
            Err(refusal(reading, innovation, variance))
        }
    }

    /// Compares a reading with its prediction.
    #[inline(always)]
    pub(crate) fn compare(
        &self,
        parts: &Parts<T, B>,
        reading: Reading<T>,
        phase: Option<Phase>,
        mut spread: RateSpread<T, S>,
    ) -> Compared<T, B> {
        let law = &self.reading;
        let (mut expected, slope, viscosity, open) = law.of_motion(parts.strain, parts.rate, phase, &mut spread);

        // P Hᵀ, and S = H P Hᵀ + R.
        let mut strain = slope * parts.strain_variance + viscosity * parts.strain_rate;
        let mut rate = slope * parts.strain_rate + viscosity * parts.rate_variance;
        let along = |part: &Part<T, B>| slope * part.with_strain + viscosity * part.with_rate;
        let mut branches: [T; B] = core::array::from_fn(|i| along(&parts.branches[i]) + parts.branches[i].variance);
        for i in 0..B {
            let part = &parts.branches[i];
            expected += part.mean;
            strain += part.with_strain;
            rate += part.with_rate;
            for k in 0..i {
                branches[i] += part.with[k];
                branches[k] += part.with[k];
            }
        }
        let mut baseline = T::zero();
        if Self::HAS_BASELINE {
            let part = &parts.baseline;
            expected += part.mean;
            strain += part.with_strain;
            rate += part.with_rate;
            baseline = along(part) + part.variance;
            for i in 0..B {
                branches[i] += part.with[i];
                baseline += part.with[i];
            }
        }
        let mut variance = law.variance + reading.extra_variance + open + slope * strain + viscosity * rate;
        for branch in &branches {
            variance += *branch;
        }
        if Self::HAS_BASELINE {
            variance += baseline;
        }

        let innovation = reading.value - expected;
        Compared { slope, viscosity, strain, rate, branches, baseline, variance, innovation }
    }
}

/// Why a reading was not taken.
#[cold]
fn refusal<T: Scalar>(reading: Reading<T>, innovation: T, variance: T) -> StepError {
    if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
        StepError::NonFiniteReading
    } else if reading.extra_variance < T::zero() {
        StepError::NegativeVariance
    } else if innovation.is_finite() && !(variance > T::zero() && variance.is_finite()) {
        StepError::NonPositiveInnovationVariance
    } else {
        StepError::NonFiniteState
    }
}
