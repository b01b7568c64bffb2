//! Bounds on the strain without readings.

use ohmstrain_model::StrainRange;

use crate::Recordable;

/// Distance that a body can have moved since the last reading.
///
/// A motion's pull toward a mean strain, and the resulting stationary spread, are fitted to rows with readings; for a pause
/// they may not hold. Without the pull, a rate v̇ = -v/T + noise, known at the start, moves the strain in t seconds by a
/// distance of variance σ²T² (2x - 3 + 4 exp(-x) - exp(-2x)), with x = t/T and σ the standard deviation of the rate (Uhlenbeck
/// and Ornstein, *Phys. Rev.* 36 (1930) 823). The formula used here is 2x³/(3 + 3x/2 + x²), which has the same limits, 2x³/3
/// and 2x - 3, differs by less than a tenth, and does not cancel. Eventually the strain may be anywhere in the limits, but no
/// farther: its mean squared distance from an estimate m is then span²/12 + (m - centre)².
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Unread<T> {
    /// Correlation time of the rate, s.
    pub rate_time_s: T,
    /// 2 (σT)²: twice the variance of a path at a constant rate over `rate_time_s`.
    pub path_variance: T,
    /// Centre of the limits; `anywhere` is the variance of a strain uniform within them.
    pub centre: T,
    /// See [`Self::centre`].
    pub anywhere: T,
}

/// Assumed time since the last reading, s, before the first reading.
pub const NEVER_READ_S: f64 = 1e9;

impl<T: Recordable> Unread<T> {
    /// Computes the bounds for a motion whose rate has the correlation time `rate_time_s` and a standard deviation,
    /// 1/s.
    ///
    /// ```
    /// use ohmstrain_ekf::live::Unread;
    /// use ohmstrain_model::StrainRange;
    ///
    /// let unread = Unread::new(2.0, 0.02, StrainRange { lower: 0.0, upper: 0.3 });
    /// // A second after the last reading, of an estimate in the middle of the limits, and six hours after it.
    /// assert!(unread.variance(1.0_f64, unread.centre, 1e-6).sqrt() < 0.05);
    /// assert_eq!(unread.variance(21_600.0, unread.centre, 1e-6), unread.anywhere);
    /// ```
    #[must_use]
    pub fn new(rate_time_s: T, rate_sd_per_s: T, limits: StrainRange<T>) -> Self {
        let (path, span) = (rate_sd_per_s * rate_time_s, limits.upper - limits.lower);
        Self {
            rate_time_s,
            path_variance: T::of(2.0) * (path * path),
            centre: limits.lower + T::of(0.5) * span,
            anywhere: limits.variance_of_anywhere(),
        }
    }

    /// Returns the variance of a strain after `seconds` without a reading, given a filter's estimate and its `stated`
    /// variance.
    pub fn variance(&self, seconds: T, strain: T, stated: T) -> T {
        let times = seconds / self.rate_time_s;
        let share = times * times / (T::of(3.0) + times * (T::of(1.5) + times));
        let moved = self.path_variance * (times * share);
        let off = strain - self.centre;
        stated.max(moved).min(off * off + self.anywhere)
    }
}

impl Unread<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> Unread<T> {
        Unread {
            rate_time_s: T::of(self.rate_time_s),
            path_variance: T::of(self.path_variance),
            centre: T::of(self.centre),
            anywhere: T::of(self.anywhere),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Unread;

    /// Returns the variance of the path as the integral of the rate's covariance, summed naively. A rate known at the
    /// start has cov(v(s), v(u)) = σ² (exp(-|s - u|/T) - exp(-(s + u)/T)). The midpoint rule with 400 steps has a
    /// relative error of 1e-5.
    fn summed(rate_sd: f64, rate_time_s: f64, seconds: f64) -> f64 {
        let step_s = seconds / 400.0;
        let times = || (0..400).map(|k| (f64::from(k) + 0.5) * step_s);
        let covariance = |s: f64, u: f64| (-(s - u).abs() / rate_time_s).exp() - (-(s + u) / rate_time_s).exp();
        let sum: f64 = times().flat_map(|s| times().map(move |u| covariance(s, u))).sum();
        rate_sd * rate_sd * step_s * step_s * sum
    }

    #[test]
    fn a_path_grows_as_its_motion_without_the_pull() {
        let (rate_sd, rate_time_s) = (0.03_f64, 2.0);
        let path_variance = 2.0 * (rate_sd * rate_time_s).powi(2);
        // Limits too wide to be reached.
        let unread = Unread { rate_time_s, path_variance, centre: 0.0, anywhere: 1e6 };
        for seconds in [0.02, 0.2, 1.0, 2.0, 4.0, 10.0, 60.0] {
            let found = unread.variance(seconds, 0.0, 0.0);
            let expected = summed(rate_sd, rate_time_s, seconds);
            assert!((found / expected - 1.0).abs() < 0.1, "{seconds} s: {found} for {expected}");
        }
    }

    /// Tests that 1.96 standard deviations reach a strain that may be anywhere, from any estimate within the limits.
    #[test]
    fn what_may_be_anywhere_is_covered_everywhere() {
        let unread = Unread { rate_time_s: 2.0, path_variance: 1e-3, centre: 0.15, anywhere: 0.3 * 0.3 / 12.0 };
        for (mean, stated) in [0.0, 0.05, 0.15, 0.3].into_iter().flat_map(|mean| [(mean, 1e-6), (mean, 9.0)]) {
            let deviation = unread.variance(21_600.0_f64, mean, stated).sqrt();
            for strain in [0.0, 0.1, 0.3] {
                let off: f64 = strain - mean;
                assert!(off.abs() < 1.96 * deviation, "{strain} from {mean}: {deviation}");
            }
            assert!(deviation < 0.58 * 0.3, "{deviation}");
        }
    }
}
