//! The update with a reading, in place: `P - (P Hᵀ)(P Hᵀ)ᵀ/S`.

use ohmstrain_model::{Phase, Scalar, SwitchedModel};

use super::curve::CurveLine;
use super::predict::{dot, sum};
use super::{Curve, Lanes, Part, Parts, RateSpread, Several, SparseEkf, Switch};
use crate::{Reading, Residual, StepError};

/// A reading compared with its prediction.
#[derive(Clone, Copy)]
pub(crate) struct Compared<V, const B: usize> {
    /// Covariances of the state with the reading.
    pub strain: V,
    pub rate: V,
    pub branches: [V; B],
    pub baseline: V,
    /// Variance S of the innovation.
    pub variance: V,
    pub innovation: V,
}

/// Reading as a function of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReadingLaw<T, G> {
    pub curve: G,
    pub extend_viscosity_s: T,
    pub retract_viscosity_s: T,
    pub variance: T,
}

/// Expected reading due to motion alone.
struct OfMotion<V> {
    expected: V,
    /// Derivatives with respect to strain and rate.
    slope: V,
    viscosity: V,
    /// Variance due to the gauge's linearisation, and to an uncertain direction of the dash-pot.
    open: V,
}

impl<T: Scalar, G: Curve<T>> ReadingLaw<T, G> {
    pub(crate) fn new<const B: usize, const N: usize>(model: &SwitchedModel<T, B, N>) -> Option<Self> {
        let law = model.law();
        Some(Self {
            curve: G::new(&law.gauge, &law.range)?,
            extend_viscosity_s: law.extend_viscosity_s,
            retract_viscosity_s: law.retract_viscosity_s,
            variance: model.noise().reading_sd * model.noise().reading_sd,
        })
    }

    #[inline(always)]
    fn of_motion<V: Lanes<Number = T>, S: Switch<V>>(
        &self,
        (strain, strain_variance): (V, V),
        rate: V,
        phase: Option<Phase>,
        spread: &mut RateSpread<V, S>,
    ) -> OfMotion<V> {
        let CurveLine { value: gauge, slope, left } = self.curve.line(strain, strain_variance);
        let zero = strain.nothing();
        let (extend, retract) = (strain.with(self.extend_viscosity_s), strain.with(self.retract_viscosity_s));
        let still = OfMotion { expected: gauge, slope, viscosity: zero, open: left.unwrap_or(zero) };
        match phase {
            Some(Phase::Hold) => return still,
            Some(Phase::Extend) => return still.moving(extend, rate),
            Some(Phase::Retract) => return still.moving(retract, rate),
            None => {}
        }
        let uncertain = (rate * rate).less(spread.variance.scale(RateSpread::<V, S>::clear()));
        if V::none(uncertain) {
            return still.moving(V::pick(zero.less(rate), extend, retract), rate);
        }
        let (split, jump) = (spread.blend(rate), extend - retract);
        let expected = sum(gauge, [split.extend, split.retract], [extend, retract]);
        let viscosity = dot([split.extend_probability, split.retract_probability], [extend, retract]);
        let of_split = jump * jump * split.variance;
        let open = OfMotion { expected, slope, viscosity, open: left.map_or(of_split, |left| left + of_split) };
        if V::all(uncertain) {
            return open;
        }
        let clear = still.moving(V::pick(zero.less(rate), extend, retract), rate);
        OfMotion {
            expected: V::pick(uncertain, open.expected, clear.expected),
            slope,
            viscosity: V::pick(uncertain, open.viscosity, clear.viscosity),
            open: V::pick(uncertain, open.open, clear.open),
        }
    }
}

impl<V: Lanes> OfMotion<V> {
    /// Adds a dash-pot whose direction is known.
    #[inline(always)]
    fn moving(self, viscosity: V, rate: V) -> Self {
        Self { expected: viscosity.mul_add(rate, self.expected), viscosity, ..self }
    }
}

impl<T: Scalar, S, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Takes readings in the lanes `present`, or only compares them if `takes` is false for their NIS. `phase` is a hypothesis, as for
    /// [`Channel::observe`](crate::Channel::observe); with `None` the rate is split using its variance in `spread`. Returns the
    /// comparison, and the lanes with a valid result; in others `parts` is meaningless.
    #[inline(always)]
    pub(crate) fn update<V: Several<Number = T>, X: Switch<V>>(
        &self,
        parts: &mut Parts<V, B>,
        reading: Reading<V>,
        phase: Option<Phase>,
        spread: RateSpread<V, X>,
        present: V::Mask,
        takes: impl FnOnce(V) -> bool,
    ) -> (Residual<V>, V::Mask) {
        let compared = self.compare(parts, reading, phase, spread);
        let Compared { innovation, variance, .. } = compared;
        let mut nis = innovation * (innovation * variance.recip());
        if takes(nis) {
            nis = Self::correct(parts, &compared, present);
        }
        // If S and ν²/S are finite and S is positive, everything before was finite. If no variance is negative, no gain can
        // have overflowed (Cauchy-Schwarz). Only the means remain to be checked.
        let mut sound = V::both(variance.nothing().less(variance), reading.extra_variance.not_negative());
        if !V::none(sound) {
            sound = V::both(sound, parts.is_sound::<N>(variance + nis));
        }
        (Residual { innovation, variance, nis }, sound)
    }

    /// Compares a reading with its prediction.
    #[inline(always)]
    pub(crate) fn compare<V: Lanes<Number = T>, X: Switch<V>>(
        &self,
        parts: &Parts<V, B>,
        reading: Reading<V>,
        phase: Option<Phase>,
        mut spread: RateSpread<V, X>,
    ) -> Compared<V, B> {
        let strain = (parts.strain, parts.strain_variance);
        let of_motion = self.reading.of_motion(strain, parts.rate, phase, &mut spread);
        let OfMotion { mut expected, slope, viscosity, open } = of_motion;

        // P Hᵀ, and S = H P Hᵀ + R.
        let along = [slope, viscosity];
        let mut strain = dot(along, [parts.strain_variance, parts.strain_rate]);
        let mut rate = dot(along, [parts.strain_rate, parts.rate_variance]);
        let mut branches = [expected; B];
        for i in 0..B {
            let part = &parts.branches[i];
            branches[i] = dot(along, [part.with_strain, part.with_rate]) + part.variance;
        }
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
        let mut baseline = strain.nothing();
        if Self::HAS_BASELINE {
            let part = &parts.baseline;
            expected += part.mean;
            strain += part.with_strain;
            rate += part.with_rate;
            baseline = dot(along, [part.with_strain, part.with_rate]) + part.variance;
            for i in 0..B {
                branches[i] += part.with[i];
                baseline += part.with[i];
            }
        }
        let noise = reading.extra_variance + strain.with(self.reading.variance) + open;
        let mut variance = sum(noise, along, [strain, rate]);
        for i in 0..B {
            variance += branches[i];
        }
        if Self::HAS_BASELINE {
            variance += baseline;
        }

        let innovation = reading.value - expected;
        Compared { strain, rate, branches, baseline, variance, innovation }
    }

    /// Takes the readings in the lanes `present`, and returns their NIS.
    #[inline(always)]
    pub(crate) fn correct<V: Lanes<Number = T>>(
        parts: &mut Parts<V, B>,
        compared: &Compared<V, B>,
        present: V::Mask,
    ) -> V {
        let Compared { strain, rate, branches, baseline, variance, innovation } = *compared;
        let zero = variance.nothing();
        let per_variance = V::pick(present, variance.recip(), zero);
        let scaled = V::pick(present, innovation * per_variance, zero);
        parts.strain = strain.mul_add(scaled, parts.strain);
        parts.rate = rate.mul_add(scaled, parts.rate);
        let (of_strain, of_rate) = (-(strain * per_variance), -(rate * per_variance));
        parts.strain_variance = of_strain.mul_add(strain, parts.strain_variance);
        parts.strain_rate = of_rate.mul_add(strain, parts.strain_rate);
        parts.rate_variance = of_rate.mul_add(rate, parts.rate_variance);
        for i in 0..B {
            take(&mut parts.branches[i], branches[i], i, (strain, rate, &branches), (per_variance, scaled));
        }
        if Self::HAS_BASELINE {
            take(&mut parts.baseline, baseline, B, (strain, rate, &branches), (per_variance, scaled));
        }
        innovation * scaled
    }
}

/// Updates a branch, or the baseline, whose covariance with the reading is `own`.
#[inline(always)]
fn take<V: Lanes, const B: usize>(
    part: &mut Part<V, B>,
    own: V,
    others: usize,
    (strain, rate, branches): (V, V, &[V; B]),
    (per_variance, scaled): (V, V),
) {
    let minus_gain = -(own * per_variance);
    part.mean = own.mul_add(scaled, part.mean);
    part.with_strain = minus_gain.mul_add(strain, part.with_strain);
    part.with_rate = minus_gain.mul_add(rate, part.with_rate);
    for k in 0..others {
        part.with[k] = minus_gain.mul_add(branches[k], part.with[k]);
    }
    part.variance = minus_gain.mul_add(own, part.variance);
}

/// Returns the reason for refusing a step, with a reading or without.
#[cold]
pub(crate) fn refusal<T: Scalar>(reading: Option<Reading<T>>, residual: &Residual<T>) -> StepError {
    let Some(reading) = reading else { return StepError::NonFiniteState };
    let Residual { innovation, variance, .. } = *residual;
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
