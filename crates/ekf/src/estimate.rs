use ohmstrain_model::{Scalar, StrainRange, SwitchedModel};

use crate::{Belief, Gaussian, Real};

/// What a user wants to know, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T> {
    /// Strain, its mean moved into the limits.
    pub strain: Gaussian<T>,
    /// Strain rate, 1/s.
    pub rate: Gaussian<T>,
    /// Sum of the relaxing branches, relative to R₀.
    pub relaxation: Gaussian<T>,
    /// Baseline, relative to R₀; zero where the model has none.
    pub baseline: T,
    /// Where R/R₀ - 1 will settle if the strain is held from now on: g(ε), with the law's long-run uncertainty.
    pub settled: Gaussian<T>,
    /// Probability that the strain is beyond the static border, where one reading belongs to two strains; zero where
    /// the gauge curve has no peak in its range.
    pub beyond_border: T,
}

impl<T: Real> Estimate<T> {
    /// The estimate that a belief about a sensor's state stands for. `limits` act on the reported strain only; the
    /// belief goes on unrestricted.
    #[must_use]
    pub fn new<const M: usize, const B: usize, const N: usize, const L: usize>(
        model: &SwitchedModel<T, M, B, N>,
        belief: &Belief<T, N, L>,
        limits: &StrainRange<T>,
    ) -> Self {
        let marginal = |i: usize| Gaussian { mean: belief.mean[i], variance: belief.covariance[(i, i)].max(T::zero()) };
        let strain = marginal(0).clamped(limits);
        let mut relaxation = Gaussian { mean: T::zero(), variance: T::zero() };
        for i in M..M + B {
            relaxation.mean += belief.mean[i];
            for j in M..M + B {
                relaxation.variance += belief.covariance[(i, j)];
            }
        }
        let (gauge, slope) = model.law().gauge_value_and_slope(strain.mean);
        let noise = model.noise();
        let wander = noise.baseline_sd * noise.baseline_sd + T::of(B as f64) * noise.branch_sd * noise.branch_sd;
        Self {
            strain,
            rate: marginal(1),
            relaxation: Gaussian { variance: relaxation.variance.max(T::zero()), ..relaxation },
            baseline: if N > M + B { belief.mean[N - 1] } else { T::zero() },
            settled: Gaussian { mean: gauge, variance: slope * slope * strain.variance + wander },
            beyond_border: model.law().static_border().map_or(T::zero(), |border| strain.probability_above(border)),
        }
    }
}

impl<T: Scalar> Gaussian<T> {
    /// Standard deviation.
    #[must_use]
    pub fn sd(&self) -> T {
        self.variance.max(T::zero()).sqrt()
    }
}
