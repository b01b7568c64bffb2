use ohmstrain_ekf::{Estimate, Gaussian, Reading};

/// R₀ of a law over the R₀ that readings are relative to: a law that was fitted with an R₀ of its own sees other ρ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OwnRest(f64);

impl OwnRest {
    /// Readings are relative to the law's own R₀.
    pub(crate) const SHARED: Self = Self(1.0);

    pub(crate) const fn new(ratio: f64) -> Self {
        Self(ratio)
    }

    /// `ρ` as the law sees it: R over its own R₀, minus 1.
    pub(crate) fn reading(self, reading: Reading<f64>) -> Reading<f64> {
        if self == Self::SHARED {
            return reading;
        }
        Reading {
            value: (1.0 + reading.value) / self.0 - 1.0,
            extra_variance: reading.extra_variance / (self.0 * self.0),
        }
    }

    /// What is said of `ρ`, relative to the R₀ of the readings. Strain and rate are what they are.
    pub(crate) fn estimate(self, estimate: Estimate<f64>) -> Estimate<f64> {
        if self == Self::SHARED {
            return estimate;
        }
        let scaled = |part: Gaussian<f64>, mean: f64| Gaussian { mean, variance: part.variance * self.0 * self.0 };
        Estimate {
            relaxation: scaled(estimate.relaxation, self.0 * estimate.relaxation.mean),
            baseline: self.0 * estimate.baseline,
            settled: scaled(estimate.settled, self.0 * (1.0 + estimate.settled.mean) - 1.0),
            ..estimate
        }
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::{Estimate, Gaussian, Reading};

    use super::OwnRest;

    /// 1200 Ω over an R₀ of 1000 Ω, and over a law's own R₀ of 1250 Ω; all in powers of two or few digits.
    #[test]
    fn resistances_are_the_same_whatever_they_are_relative_to() {
        let own = OwnRest::new(1.25);
        let reading = own.reading(Reading { value: 0.2, extra_variance: 0.01 });
        assert!((reading.value - (1200.0 / 1250.0 - 1.0)).abs() < 1e-15);
        assert!((reading.extra_variance.sqrt() * 1250.0 - 0.1 * 1000.0).abs() < 1e-12);

        let part = |mean: f64| Gaussian { mean, variance: 0.04 };
        let estimate = own.estimate(Estimate {
            strain: part(0.3),
            rate: part(0.1),
            relaxation: part(0.08),
            baseline: 0.016,
            settled: part(-0.04),
            beyond_border: 0.0,
            near_ramp_border: false,
        });
        assert_eq!((estimate.strain, estimate.rate), (part(0.3), part(0.1)));
        // 100 Ω, 20 Ω and 1200 Ω.
        assert!((estimate.relaxation.mean - 0.1).abs() < 1e-15 && (estimate.baseline - 0.02).abs() < 1e-15);
        assert!((estimate.settled.mean - 0.2).abs() < 1e-15 && (estimate.settled.sd() - 0.25).abs() < 1e-15);
    }
}
