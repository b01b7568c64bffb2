use ohmstrain_model::{MOTION_STATES, ModelNoise, Phase, Scalar, StrainRange, SwitchedModel};

use crate::live::reported;
use crate::{Belief, Gaussian, Real, State};

/// Estimate reported to the user: strain, rate and the rest, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate<T> {
    /// Strain, its mean clamped to the limits.
    pub strain: Gaussian<T>,
    /// Strain rate, 1/s.
    pub rate: Gaussian<T>,
    /// Sum of the relaxing branches, relative to R₀.
    pub relaxation: Gaussian<T>,
    /// Baseline, relative to R₀; zero where the model has none.
    pub baseline: T,
    /// R/R₀ - 1 of the sensor without its rate term: g(ε), branches and baseline over all hypotheses. In a hold it is the
    /// expected reading.
    pub held: Gaussian<T>,
    /// Amount by which `held` will fall if the strain is held from now on; see [`Settling`].
    pub still_relaxes: Gaussian<T>,
    /// Probability that the strain is beyond the static border, where one reading belongs to two strains; zero where
    /// the gauge curve has no peak in its range.
    pub beyond_border: T,
    /// True if the *ramp* border is near: the strain at which the reading, at the present speed, stops rising or falling
    /// although the body keeps moving. The static border limits the information in a reading at rest, the ramp border that in
    /// motion.
    pub near_ramp_border: bool,
}

/// Relaxation of the readings while the strain is held.
///
/// The branches of the law predict the fall of a reading within `horizon_s`. Only a `share` of it occurs: laws are fitted to motion
/// and to drift, and their slow branches absorb more than relaxation. The prediction's error grows with the remaining relaxation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settling<T> {
    /// Time for which the strain is held, s.
    pub horizon_s: T,
    /// Fraction of the branches' predicted relaxation that occurs.
    pub share: T,
    /// Its standard deviation.
    pub share_sd: T,
    /// Standard deviation of the part that does not grow with the relaxation, relative to R₀.
    pub sd: T,
}

/// Assumed duration of a hold, s, for a sensor without holds in its calibration.
const UNSEEN_HORIZON_S: f64 = 60.0;

impl<T: Real> Settling<T> {
    /// Returns the settling of a sensor without calibrated holds: a uniformly distributed share, and the wander of branches
    /// and baseline.
    #[must_use]
    pub fn unseen(noise: &ModelNoise<T>, branches: usize) -> Self {
        let wander = noise.baseline_sd * noise.baseline_sd + T::of(branches as f64) * noise.branch_sd * noise.branch_sd;
        Self {
            horizon_s: T::of(UNSEEN_HORIZON_S),
            share: T::of(0.5),
            share_sd: T::of(1.0 / 12.0).sqrt(),
            sd: wander.sqrt(),
        }
    }

    /// Returns the expected fall of a reading if the branches relax by `relaxes`.
    fn of(&self, relaxes: T) -> Gaussian<T> {
        let unsure = self.share_sd * relaxes;
        Gaussian { mean: self.share * relaxes, variance: self.sd * self.sd + unsure * unsure }
    }
}

impl<T: Real> Estimate<T> {
    /// Returns the estimate of a state. `limits` act on the reported strain only; the state is not restricted.
    /// `strain_sd_scale` multiplies the strain's standard deviation (1 for no effect); calibration determines it.
    #[must_use]
    pub fn new<S: State<T, N, L>, const B: usize, const N: usize, const L: usize>(
        model: &SwitchedModel<T, B, N>,
        state: &S,
        limits: &StrainRange<T>,
        strain_sd_scale: T,
        settling: &Settling<T>,
    ) -> Self {
        let belief = &state.moments();
        let strain_of = |belief: &Belief<T, N, L>| reported(Gaussian::marginal(belief, 0), strain_sd_scale, limits);
        let (strain, rate) = (strain_of(belief), Gaussian::marginal(belief, 1));
        let border = model.law().static_border();
        let mut beyond_border = T::zero();
        let mut held = (T::zero(), T::zero());
        state.each(&mut |weight, belief| {
            let strain = strain_of(belief);
            beyond_border += border.map_or(T::zero(), |border| weight * strain.probability_above(border));
            let Gaussian { mean, variance } = standing_still(model, belief);
            held.0 += weight * mean;
            held.1 += weight * (mean * mean + variance);
        });
        let spread = (held.1 - held.0 * held.0).max(T::zero());
        Self {
            strain,
            rate,
            relaxation: relaxation::<T, B, N, L>(belief),
            baseline: if N > MOTION_STATES + B { belief.mean[MOTION_STATES + B] } else { T::zero() },
            held: Gaussian { mean: held.0, variance: spread },
            still_relaxes: settling.of(relaxes_within(model, belief, settling.horizon_s)),
            beyond_border,
            near_ramp_border: near_ramp_border(model, belief, &strain, &rate),
        }
    }

    /// Returns the settled R/R₀ - 1 if the strain is held from now on, predicted from the state alone. If there is a reading, the
    /// reading minus [`Self::still_relaxes`] is the better prediction, because it contains the law's errors up to now.
    #[must_use]
    pub fn settled(&self) -> Gaussian<T> {
        let (held, falls) = (self.held, self.still_relaxes);
        Gaussian { mean: held.mean - falls.mean, variance: held.variance + falls.variance }
    }
}

/// Returns R/R₀ - 1 at rate zero. Its terms are much less certain than their sum, which is the reading.
fn standing_still<T: Real, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<T, B, N>,
    belief: &Belief<T, N, L>,
) -> Gaussian<T> {
    let (mut mean, slope) = model.law().gauge_value_and_slope(belief.mean[0]);
    let mut variance = slope * slope * belief.covariance[(0, 0)];
    for i in MOTION_STATES..N {
        mean += belief.mean[i];
        variance += T::of(2.0) * slope * belief.covariance[(i, 0)];
        for j in MOTION_STATES..N {
            variance += belief.covariance[(i, j)];
        }
    }
    Gaussian { mean, variance: variance.max(T::zero()) }
}

/// Returns the fall of the branches if nothing drives them: Σ cᵢ (1 - exp(-h/τᵢ)).
fn relaxes_within<T: Real, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<T, B, N>,
    belief: &Belief<T, N, L>,
    horizon_s: T,
) -> T {
    let branches = model.law().branches.iter().enumerate();
    branches
        .fold(T::zero(), |sum, (i, branch)| sum - belief.mean[MOTION_STATES + i] * (-horizon_s / branch.tau_s).exp_m1())
}

/// Returns the sum of the branches.
fn relaxation<T: Scalar, const B: usize, const N: usize, const L: usize>(belief: &Belief<T, N, L>) -> Gaussian<T> {
    let (mut mean, mut variance) = (T::zero(), T::zero());
    for i in MOTION_STATES..MOTION_STATES + B {
        mean += belief.mean[i];
        for j in MOTION_STATES..MOTION_STATES + B {
            variance += belief.covariance[(i, j)];
        }
    }
    Gaussian { mean, variance: variance.max(T::zero()) }
}

/// Half width of the strain interval searched for a ramp border, in standard deviations.
const NEAR: f64 = 2.0;

/// True if the reading has an extremum along the present movement, dρ/dt = 0, within two standard deviations of the
/// strain. A body whose rate is indistinguishable from zero is on no ramp.
fn near_ramp_border<T: Scalar, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<T, B, N>,
    belief: &Belief<T, N, L>,
    strain: &Gaussian<T>,
    rate: &Gaussian<T>,
) -> bool {
    if rate.mean.abs() <= T::of(NEAR) * rate.sd() {
        return false;
    }
    let phase = if rate.mean > T::zero() { Phase::Extend } else { Phase::Retract };
    let relaxation = core::array::from_fn(|i| belief.mean[MOTION_STATES + i]);
    let slope = |strain: T| model.law().ramp_slope(strain, rate.mean, &relaxation, phase);
    let reach = T::of(NEAR) * strain.sd();
    let (below, above) = (slope(strain.mean - reach), slope(strain.mean + reach));
    (below > T::zero()) != (above > T::zero())
}

impl<T: Scalar> Gaussian<T> {
    /// Returns the marginal distribution of one component of a belief.
    #[must_use]
    pub fn marginal<const N: usize, const L: usize>(belief: &Belief<T, N, L>, index: usize) -> Self {
        Self { mean: belief.mean[index], variance: belief.covariance[(index, index)].max(T::zero()) }
    }

    /// Standard deviation.
    #[must_use]
    pub fn sd(&self) -> T {
        self.variance.max(T::zero()).sqrt()
    }
}
