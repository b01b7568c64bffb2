use ohmstrain_ekf::Gaussian;

/// What a strain that was known for a moment says of the errors since: errors of a correction hang together for seconds, so
/// that one which is known now is known in part a little later.
///
/// The error is taken for an Ornstein-Uhlenbeck process of the variance that was stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KnownError {
    time_s: f64,
    /// For how long errors last, s.
    lasts_s: f64,
    /// Known strain minus what was said, as far as it is told from the uncertainty of what is known.
    error: f64,
    /// Share of the stated variance that knowing it takes away, 0 to 1.
    told: f64,
}

impl KnownError {
    /// At `time_s` the strain was `known`, where `said` was stated of it.
    pub(crate) fn new(time_s: f64, lasts_s: f64, known: &Gaussian<f64>, said: &Gaussian<f64>) -> Self {
        let told = said.variance / (said.variance + known.variance);
        let told = if told.is_finite() { told } else { 0.0 };
        Self { time_s, lasts_s, error: told * (known.mean - said.mean), told }
    }

    /// A statement at a later time, without what is left of that error.
    pub(crate) fn correct(&self, time_s: f64, said: Gaussian<f64>) -> Gaussian<f64> {
        let left = (-(time_s - self.time_s).max(0.0) / self.lasts_s).exp();
        Gaussian { mean: said.mean + left * self.error, variance: said.variance * (1.0 - left * left * self.told) }
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::Gaussian;

    use super::KnownError;

    /// Against the conditional distribution of two Gaussian numbers, written out: error e₀ now and e₁ later, of variance v and
    /// correlation exp(-t/T), and e₀ + n known with n of variance r.
    #[test]
    fn a_known_error_is_conditioned_on() {
        let (v, r, lasts_s) = (0.04, 0.01, 5.0);
        let said = Gaussian { mean: 0.1, variance: v };
        let known = KnownError::new(3.0, lasts_s, &Gaussian { mean: 0.25, variance: r }, &said);
        for later_s in [0.0, 1.0, 5.0, 60.0] {
            let covariance = v * f64::exp(-later_s / lasts_s);
            let expected =
                Gaussian { mean: 0.1 + covariance / (v + r) * 0.15, variance: v - covariance * covariance / (v + r) };
            let found = known.correct(3.0 + later_s, said);
            assert!((found.mean - expected.mean).abs() < 1e-15, "{later_s} s: {found:?} {expected:?}");
            assert!((found.variance - expected.variance).abs() < 1e-15, "{later_s} s: {found:?} {expected:?}");
        }
    }
}
