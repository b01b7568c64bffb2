use ohmstrain_model::{MOTION_STATES, Phase, Scalar, StrainRange, SwitchedModel};

use crate::{Belief, Gaussian, Real, State};

/// What a user wants to know, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate<T> {
    /// Strain, its mean moved into the limits.
    pub strain: Gaussian<T>,
    /// Strain rate, 1/s.
    pub rate: Gaussian<T>,
    /// Sum of the relaxing branches, relative to R₀.
    pub relaxation: Gaussian<T>,
    /// Baseline, relative to R₀; zero where the model has none.
    pub baseline: T,
    /// Where R/R₀ - 1 will settle if the strain is held from now on: g(ε) over all hypotheses, with the law's long-run
    /// uncertainty.
    pub settled: Gaussian<T>,
    /// Probability that the strain is beyond the static border, where one reading belongs to two strains; zero where
    /// the gauge curve has no peak in its range.
    pub beyond_border: T,
    /// Whether the *ramp* border is near: the strain at which the reading, at the present speed, stops rising or falling
    /// though the body goes on. The static border tells what a reading means at rest, this one what it tells now.
    pub near_ramp_border: bool,
}

impl<T: Real> Estimate<T> {
    /// The estimate that a state stands for. `limits` act on the reported strain only, the state goes on unrestricted;
    /// `strain_sd_scale` multiplies the strain's standard deviation (1 for none), as a calibration found it necessary.
    #[must_use]
    pub fn new<S: State<T, N, L>, const B: usize, const N: usize, const L: usize>(
        model: &SwitchedModel<T, B, N>,
        state: &S,
        limits: &StrainRange<T>,
        strain_sd_scale: T,
    ) -> Self {
        let belief = &state.moments();
        let strain_of = |belief: &Belief<T, N, L>| {
            let variance = belief.covariance[(0, 0)].max(T::zero()) * strain_sd_scale * strain_sd_scale;
            Gaussian { mean: belief.mean[0], variance }.clamped(limits)
        };
        let (strain, rate) = (strain_of(belief), Gaussian::marginal(belief, 1));
        let border = model.law().static_border();
        let mut beyond_border = T::zero();
        let mut settled = (T::zero(), T::zero());
        state.each(&mut |weight, belief| {
            let strain = strain_of(belief);
            beyond_border += border.map_or(T::zero(), |border| weight * strain.probability_above(border));
            let (gauge, slope) = model.law().gauge_value_and_slope(strain.mean);
            settled.0 += weight * gauge;
            settled.1 += weight * (gauge * gauge + slope * slope * strain.variance);
        });
        let noise = model.noise();
        let wander = noise.baseline_sd * noise.baseline_sd + T::of(B as f64) * noise.branch_sd * noise.branch_sd;
        let spread = (settled.1 - settled.0 * settled.0).max(T::zero());
        Self {
            strain,
            rate,
            relaxation: relaxation::<T, B, N, L>(belief),
            baseline: if N > MOTION_STATES + B { belief.mean[MOTION_STATES + B] } else { T::zero() },
            settled: Gaussian { mean: settled.0, variance: spread + wander },
            beyond_border,
            near_ramp_border: near_ramp_border(model, belief, &strain, &rate),
        }
    }
}

/// Sum of the branches.
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

/// Deviations to each side within which a strain is looked for.
const NEAR: f64 = 2.0;

/// Whether the reading has an extremum along the present movement, dρ/dt = 0, within two deviations of the strain. A body
/// whose rate cannot be told from zero is on no ramp.
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
    /// One component of a belief by itself.
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
