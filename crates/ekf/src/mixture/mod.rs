mod children;
mod evidence;
mod genealogy;
mod hypotheses;
mod imm;
mod lineage;
mod mixing;
mod pause;
pub(crate) mod sign_split;
mod sparse;
mod sparse_hypotheses;
mod sparse_imm;
mod sparse_split;
pub(crate) mod step;
pub(crate) mod switching;

pub use evidence::MixtureResidual;
pub use hypotheses::Hypotheses;
pub use imm::Imm;
pub use sign_split::SignSplit;
pub use sparse::{PhaseMixture, Share, SparseMixture};
pub use sparse_hypotheses::SparseHypotheses;
pub use sparse_imm::SparseImm;
pub use sparse_split::SparseSignSplit;
pub use step::{Evidence, MixtureStep};
pub use switching::{Dwell, Phased};

use nalgebra::SVector;
use ohmstrain_model::{Phase, Scalar, StrainRange, Symmetric};

use crate::belief::gaussian::{Gaussian, Real};
use crate::ekf::pinned;
use crate::mixture::lineage::Recorder;
use crate::mixture::pause::{Pause, PhaseSum};
use crate::{Belief, State, StepError};

/// One hypothesis: a phase and what is known of the state if it is the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component<T, const N: usize, const L: usize> {
    /// Natural logarithm of its probability.
    pub log_weight: T,
    /// The phase it believes in.
    pub phase: Phase,
    /// The state, given the hypothesis.
    pub belief: Belief<T, N, L>,
    /// One over the probability of the strain's limits under `belief`. Only changes of the probability enter the weight:
    /// evidence that was counted once is not counted again at every step of a rest on a limit. The weight times this is what
    /// it would be without limits, so that a merged hypothesis has the mean of both.
    pub(crate) per_inside: T,
}

/// At most `K` weighted hypotheses about the state, in fixed memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture<T, const N: usize, const L: usize, const K: usize> {
    components: [Component<T, N, L>; K],
    len: usize,
    pause: Pause<T>,
}

/// Where a hypothesis went.
#[derive(Clone, Copy)]
pub(crate) enum Added {
    /// Into this place, alone or merged with what was there.
    To(usize),
    /// Into this place; what was there was merged into the other one, or dropped if no other is of its phase.
    InsteadOf(usize, Option<usize>),
    /// It is lighter than everything there is room for, and none of that is of its phase.
    Nowhere,
}

/// When two hypotheses of one phase count as one: squared distance of their strains plus that of their rates, each in
/// units of the larger variance.
pub(crate) const ALIKE: f64 = 0.5;
/// Hypotheses lighter than the heaviest by this factor, e⁻¹², are dropped.
const NEGLIGIBLE: f64 = 12.0;
/// The same factor as a number.
pub(crate) const LEAST_WEIGHT: f64 = 6.144_212_353_328_21e-6;
/// Of two hypotheses whose weights differ by no more than this share none is the lighter one: directions after a hold are
/// equally likely, and rounding is not to choose.
pub(crate) const LIGHTER: f64 = 1e-4;
/// A hypothesis that has left the limits altogether is no less likely than this.
pub(crate) const LEAST_INSIDE: f64 = 1e-9;

impl<T: Real, const N: usize, const L: usize, const K: usize> Mixture<T, N, L, K> {
    pub(crate) const CAPACITY: () =
        assert!(K >= 1 && N >= 2, "a mixture holds at least one component of strain and rate");

    /// One hypothesis that has all the weight.
    #[must_use]
    pub fn single(belief: Belief<T, N, L>, phase: Phase) -> Self {
        let mut mixture = Self::empty();
        mixture.push(Component { log_weight: T::zero(), phase, belief, per_inside: T::one() });
        mixture
    }

    pub(crate) fn empty() -> Self {
        let () = Self::CAPACITY;
        let nothing = Belief { mean: SVector::zeros(), covariance: Symmetric::zeros() };
        let vacant = Component { log_weight: T::zero(), phase: Phase::Hold, belief: nothing, per_inside: T::one() };
        Self { components: [vacant; K], len: 0, pause: Pause::over() }
    }

    pub(crate) const fn pause(&self) -> &Pause<T> {
        &self.pause
    }

    pub(crate) fn set_pause(&mut self, pause: Pause<T>) {
        self.pause = pause;
    }

    /// The hypotheses.
    #[must_use]
    pub fn components(&self) -> &[Component<T, N, L>] {
        self.components.get(..self.len).unwrap_or(&[])
    }

    fn components_mut(&mut self) -> &mut [Component<T, N, L>] {
        self.components.get_mut(..self.len).unwrap_or(&mut [])
    }

    /// Adds a hypothesis: merged with one that says the same, or in a free place. Where there is none the lightest of all
    /// makes room and is merged with the nearest of its phase: dropped, step after step, what is unlikely in each of many short
    /// steps and likely in all of them together would be lost before a reading has spoken for it. Says where it went.
    pub(crate) fn add(&mut self, candidate: &Component<T, N, L>) -> Added {
        let alike = self.components_mut().iter_mut().enumerate().find(|(_, known)| known.is_like(candidate));
        if let Some((place, like)) = alike {
            *like = like.merged(candidate);
            return Added::To(place);
        }
        if self.len < K {
            self.push(*candidate);
            return Added::To(self.len - 1);
        }
        let lighter = |a: (usize, T), b: (usize, T)| if b.1 < a.1 - T::of(LIGHTER) { b } else { a };
        let weights = self.components().iter().map(|component| component.log_weight).enumerate();
        let lightest = weights.reduce(lighter).filter(|(_, weight)| *weight < candidate.log_weight - T::of(LIGHTER));
        let Some((place, _)) = lightest else {
            return self.merge_into_nearest(candidate, None).map_or(Added::Nowhere, Added::To);
        };
        let Some(displaced) = self.components.get(place).copied() else { return Added::Nowhere };
        let into = self.merge_into_nearest(&displaced, Some(place));
        if let Some(component) = self.components.get_mut(place) {
            *component = *candidate;
        }
        Added::InsteadOf(place, into)
    }

    /// Merges a hypothesis into the nearest of its phase, in strain and rate, not counting the one at `but`; where that is.
    /// One that is negligible is dropped.
    fn merge_into_nearest(&mut self, component: &Component<T, N, L>, but: Option<usize>) -> Option<usize> {
        let heaviest = self.components().iter().fold(component.log_weight, |most, other| most.max(other.log_weight));
        if component.log_weight < heaviest - T::of(NEGLIGIBLE) {
            return None;
        }
        let others = self.components().iter().enumerate();
        let others = others.filter(|(place, other)| Some(*place) != but && other.phase == component.phase);
        let nearer = |a: (usize, T), b: (usize, T)| if b.1 < a.1 { b } else { a };
        let (place, _) = others.map(|(place, other)| (place, other.distance(component))).reduce(nearer)?;
        let nearest = self.components.get_mut(place)?;
        *nearest = nearest.merged(component);
        Some(place)
    }

    /// Adds a hypothesis as it is, if there is room.
    pub(crate) fn push(&mut self, component: Component<T, N, L>) {
        if let Some(place) = self.components.get_mut(self.len) {
            *place = component;
            self.len += 1;
        }
    }

    /// Makes the probabilities sum to one and drops what is negligible; the logarithm of the sum before.
    pub(crate) fn normalise(&mut self, recorder: &mut impl Recorder<T, N, L>) -> Result<T, StepError> {
        let heaviest = self.components().iter().map(|c| c.log_weight).reduce(|a, b| a.max(b));
        let Some(heaviest) = heaviest.filter(|weight| weight.is_finite()) else {
            return Err(StepError::NonFiniteState);
        };
        let counts = |component: &Component<T, N, L>| component.log_weight > heaviest - T::of(NEGLIGIBLE);
        recorder.renumbered(|place| {
            let (before, from_here) = self.components().split_at_checked(place)?;
            let lighter = before.iter().filter(|component| !counts(component)).count();
            from_here.first().is_some_and(counts).then_some(place - lighter)
        });
        let mut sum = T::zero();
        let mut kept = 0;
        for place in 0..self.len {
            let Some(component) = self.components.get(place).filter(|component| counts(component)) else { continue };
            sum += (component.log_weight - heaviest).exp();
            if kept < place {
                self.components.copy_within(place..=place, kept);
            }
            kept += 1;
        }
        self.len = kept;
        let log_sum = heaviest + sum.ln();
        for component in self.components_mut() {
            component.log_weight -= log_sum;
        }
        Ok(log_sum)
    }

    /// The same hypotheses with probabilities that sum to one; none is dropped, not even one without any weight.
    pub(crate) fn with_sum_one(mut self) -> Self {
        let total = self.components().iter().fold(T::zero(), |sum, component| sum + component.log_weight.exp());
        for component in self.components_mut() {
            component.log_weight -= total.ln();
        }
        self
    }

    /// Every hypothesis changed in the same way; what an error leaves behind is the caller's old mixture.
    pub(crate) fn try_map(
        &self,
        mut change: impl FnMut(&Component<T, N, L>) -> Result<Component<T, N, L>, StepError>,
    ) -> Result<Self, StepError> {
        let mut changed = Self { pause: self.pause, ..Self::empty() };
        for component in self.components() {
            changed.push(change(component)?);
        }
        Ok(changed)
    }

    /// Probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        let mut probabilities = PhaseSum::new(self.pause.open);
        for component in self.components() {
            probabilities.add(component.log_weight.exp(), component.phase, &component.belief);
        }
        probabilities.sums
    }

    /// The Gaussian with the mixture's mean and covariance.
    #[must_use]
    pub fn moments(&self) -> Belief<T, N, L> {
        moment_match(self.components().iter().map(|c| (c.log_weight.exp(), &c.belief)))
    }
}

impl<T: Real, const N: usize, const L: usize, const K: usize> State<T, N, L> for Mixture<T, N, L, K> {
    fn moments(&self) -> Belief<T, N, L> {
        self.moments()
    }

    fn marginal(&self, index: usize) -> Gaussian<T> {
        marginal_match(self.components().iter().map(|c| (c.log_weight.exp(), &c.belief)), index)
    }

    fn each(&self, visit: &mut dyn FnMut(T, &Belief<T, N, L>)) {
        for component in self.components() {
            visit(component.log_weight.exp(), &component.belief);
        }
    }

    fn phases(&self) -> Option<[T; 3]> {
        Some(self.phase_probabilities())
    }

    fn inflated(&self, factor: T) -> Self {
        let mut inflated = *self;
        for component in inflated.components_mut() {
            component.belief = component.belief.inflated(factor);
        }
        inflated
    }

    fn pinned(&self, index: usize, known: &Gaussian<T>) -> Result<Self, StepError> {
        let mut pinned = self.try_map(|component| {
            let (belief, update) = pinned(&component.belief, index, known)?;
            Ok(Component { belief, log_weight: component.log_weight + update.log_likelihood, ..*component })
        })?;
        pinned.normalise(&mut ())?;
        Ok(pinned)
    }
}

impl<T: Real, const N: usize, const L: usize> Component<T, N, L> {
    fn is_like(&self, other: &Self) -> bool {
        self.phase == other.phase && self.distance(other) < T::of(ALIKE)
    }

    /// Squared distance of strain and rate, each in units of the larger variance.
    fn distance(&self, other: &Self) -> T {
        let distance = |i: usize| {
            let apart = self.belief.mean[i] - other.belief.mean[i];
            let variance = self.belief.covariance[(i, i)].max(other.belief.covariance[(i, i)]);
            // What is known exactly is the same or is not; a difference has no size without a unit.
            if apart.is_zero() { T::zero() } else { apart * apart / variance.max(T::zero()) }
        };
        distance(0) + distance(1)
    }

    /// Both in one, with the mean and covariance of the pair.
    fn merged(&self, other: &Self) -> Self {
        let heavier = self.log_weight.max(other.log_weight);
        let (mine, theirs) = ((self.log_weight - heavier).exp(), (other.log_weight - heavier).exp());
        let total = mine + theirs;
        let (mine, theirs) = (mine / total, theirs / total);
        Self {
            log_weight: heavier + total.ln(),
            phase: self.phase,
            belief: moment_match([(mine, &self.belief), (theirs, &other.belief)].into_iter()),
            per_inside: mine * self.per_inside + theirs * other.per_inside,
        }
    }

    /// Takes in how much more, or less, probability its belief now gives to the limits.
    pub(crate) fn weigh_limits(&mut self, limits: &StrainRange<T>) {
        let strain = Gaussian { mean: self.belief.mean[0], variance: self.belief.covariance[(0, 0)] };
        let inside = strain.mass_within(limits).max(T::of(LEAST_INSIDE));
        let more_inside = inside * self.per_inside;
        // Mostly nothing is near a limit.
        if more_inside != T::one() {
            self.log_weight += more_inside.ln();
        }
        self.per_inside = T::one() / inside;
    }
}

/// Mean and covariance of a mixture of Gaussians whose weights sum to one.
pub(crate) fn moment_match<'a, T: Scalar, const N: usize, const L: usize>(
    weighted: impl Iterator<Item = (T, &'a Belief<T, N, L>)> + Clone,
) -> Belief<T, N, L> {
    let mean = weighted.clone().fold(SVector::zeros(), |sum, (weight, belief)| sum + belief.mean * weight);
    let mut covariance = Symmetric::zeros();
    for (weight, belief) in weighted {
        covariance = covariance.plus(&belief.covariance.scaled(weight));
        covariance.add_outer(&(belief.mean - mean), weight);
    }
    Belief { mean, covariance }
}

/// The same of one component of the state.
pub(crate) fn marginal_match<'a, T: Scalar, const N: usize, const L: usize>(
    weighted: impl Iterator<Item = (T, &'a Belief<T, N, L>)> + Clone,
    index: usize,
) -> Gaussian<T> {
    let mean = weighted.clone().fold(T::zero(), |sum, (weight, belief)| sum + weight * belief.mean[index]);
    let mut variance = T::zero();
    for (weight, belief) in weighted {
        let apart = belief.mean[index] - mean;
        variance += weight * (belief.covariance[(index, index)] + apart * apart);
    }
    Gaussian { mean, variance }
}

/// Restricts a belief to rates of one sign; the probability of that sign.
pub(crate) fn keep_rate_in<T: Real, const N: usize, const L: usize>(
    belief: &mut Belief<T, N, L>,
    rates: &StrainRange<T>,
) -> T {
    let rate = Gaussian { mean: belief.mean[1], variance: belief.covariance[(1, 1)] };
    if rate.variance <= T::zero() {
        return if rates.contains(rate.mean) { T::one() } else { T::zero() };
    }
    let cut = rate.restricted(rates);
    let regression = SVector::from_fn(|i, _| belief.covariance[(i, 1)]) / rate.variance;
    belief.covariance.add_outer(&regression, cut.variance - rate.variance);
    belief.mean += regression * (cut.mean - rate.mean);
    cut.mass
}

#[cfg(test)]
mod tests;
