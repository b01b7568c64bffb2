//! The likelihood on readings alone, compared with other programs on the Nile data.

use nalgebra::{matrix, vector};
use ohmstrain_calib::likelihood::{Bound, Likelihood, ModelFamily, Parameter, ReadingSeries};
use ohmstrain_ekf::{Belief, Channel, Dynamics};
use ohmstrain_model::{Observation, ParameterError, Phase, Scalar, Symmetric, Transition};

/// Annual flow of the Nile at Aswan, 1871 to 1970, 10⁸ m³ (Durbin & Koopman, 2012).
#[rustfmt::skip]
const NILE: [f64; 100] = [
    1120.0, 1160.0, 963.0, 1210.0, 1160.0, 1160.0, 813.0, 1230.0, 1370.0, 1140.0, 995.0, 935.0,
    1110.0, 994.0, 1020.0, 960.0, 1180.0, 799.0, 958.0, 1140.0, 1100.0, 1210.0, 1150.0, 1250.0,
    1260.0, 1220.0, 1030.0, 1100.0, 774.0, 840.0, 874.0, 694.0, 940.0, 833.0, 701.0, 916.0,
    692.0, 1020.0, 1050.0, 969.0, 831.0, 726.0, 456.0, 824.0, 702.0, 1120.0, 1100.0, 832.0,
    764.0, 821.0, 768.0, 845.0, 864.0, 862.0, 698.0, 845.0, 744.0, 796.0, 1040.0, 759.0,
    781.0, 865.0, 845.0, 944.0, 984.0, 897.0, 822.0, 1010.0, 771.0, 676.0, 649.0, 846.0,
    812.0, 742.0, 801.0, 1040.0, 860.0, 874.0, 848.0, 890.0, 744.0, 749.0, 838.0, 1050.0,
    918.0, 986.0, 797.0, 923.0, 975.0, 815.0, 1020.0, 906.0, 901.0, 1170.0, 912.0, 746.0,
    919.0, 718.0, 714.0, 740.0,
];

/// Maximum, standard errors and profile intervals of the local level model with an exact diffuse start, computed by
/// statsmodels and an independent implementation (`nile.json`), in agreement with the published 15099 / 1469.1 /
/// -632.54.
mod published {
    pub const MAXIMUM: [f64; 2] = [15098.519468532784, 1469.1760283280664];
    pub const LOG_LIKELIHOOD: f64 = -632.5456251030405;
    pub const STANDARD_ERRORS: [f64; 2] = [3145.5479741180607, 1280.3751272019597];
    pub const LN_STANDARD_ERRORS: [f64; 2] = [0.20833486074718002, 0.8714920038366514];
    pub const PROFILES: [[f64; 2]; 2] = [[9618.798036080254, 22123.418574553514], [252.4703673964374, 5984.9562037585]];
}

/// A random walk observed with noise; variances of readings and of the level's steps.
#[derive(Clone, Copy)]
struct Level<T>(T, T);

impl<T: Scalar> Dynamics<T, 1, 1> for Level<T> {
    type Prepared = ();

    fn prepare(&self, _dt_s: T) {}

    fn transition(&self, (): &(), from: &Belief<T, 1, 1>, _: Option<Phase>) -> Transition<T, 1, 1> {
        Transition { mean: from.mean, jacobian: matrix![T::one()], noise: Symmetric::from_diagonal(&[self.1]) }
    }
}

impl<T: Scalar> Channel<T, 1, 1> for Level<T> {
    fn observe(&self, at: &Belief<T, 1, 1>, _: Option<Phase>) -> Observation<T, 1> {
        Observation { value: at.mean[0], gradient: vector![T::one()], variance: self.0 }
    }
}

struct LocalLevel;

impl ModelFamily<1, 1> for LocalLevel {
    type Model<T: Scalar> = Level<T>;

    fn model<T: Scalar>(&self, parameters: &[T]) -> Result<Self::Model<T>, ParameterError> {
        Ok(Level(parameters[0], parameters[1]))
    }

    /// Diffuse start: after the first reading the level is that reading, with its noise.
    fn start<T: Scalar>(&self, model: &Self::Model<T>) -> Belief<T, 1, 1> {
        Belief::independent(vector![T::of(NILE[0])], &[model.0])
    }
}

/// Returns the readings after the first, which determined the start.
fn after_the_first() -> [f64; 100] {
    let mut rest = NILE;
    rest[0] = f64::NAN;
    rest
}

fn assert_close(got: f64, expected: f64, relative: f64, what: &str) {
    assert!((got / expected - 1.0).abs() <= relative, "{what}: {got} vs {expected}");
}

#[test]
fn the_nile() {
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let parameters = [Parameter::around("reading", 5e3), Parameter::around("level", 5e3)];
    let recordings = [ReadingSeries { time_s: &time_s, value: &after_the_first(), extra_sd: &[] }];
    let likelihood = Likelihood::<_, 1, 1> { family: &LocalLevel, parameters: &parameters, recordings: &recordings };
    let fit = likelihood.fit().unwrap();
    assert!(fit.converged && fit.gradient_norm < 1e-8, "{fit:?}");
    // Both programs stop where the likelihood no longer rises in double precision: at a flat maximum, with 1e-8
    // standard errors of rounding in ln θ for ours and 1e-7 for a search without derivatives.
    assert_close(fit.log_likelihood.value, published::LOG_LIKELIHOOD, 1e-13, "log-likelihood");
    for (i, parameter) in fit.parameters.iter().enumerate() {
        assert_close(parameter.value, published::MAXIMUM[i], 1e-6, "maximum");
        assert_close(parameter.standard_error.unwrap(), published::STANDARD_ERRORS[i], 1e-5, "standard error");
        assert_close(parameter.ln_standard_error.unwrap(), published::LN_STANDARD_ERRORS[i], 1e-5, "log scale");
        let [lower, upper] = published::PROFILES[i];
        let interval = likelihood.profile_interval(&fit, i);
        assert_close(interval.lower.unwrap(), lower, 1e-6, "lower end");
        assert_close(interval.upper.unwrap(), upper, 1e-6, "upper end");
    }
}

#[test]
fn the_start_of_the_search_does_not_matter() {
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let recordings = [ReadingSeries { time_s: &time_s, value: &after_the_first(), extra_sd: &[] }];
    for (reading, level) in [(1.0, 1.0), (1e7, 1e-2), (1e-1, 1e6), (1e4, 1e3)] {
        let parameters = [("reading", reading), ("level", level)].map(|(name, start)| Parameter {
            name,
            start,
            lower: 1e-3,
            upper: 1e9,
        });
        let likelihood =
            Likelihood::<_, 1, 1> { family: &LocalLevel, parameters: &parameters, recordings: &recordings };
        let fit = likelihood.fit().unwrap();
        assert!(fit.converged && fit.iterations < 60, "{fit:?}");
        for (parameter, expected) in fit.parameters.iter().zip(published::MAXIMUM) {
            assert_close(parameter.value, expected, 1e-6, "maximum");
        }
    }
}

#[test]
fn a_parameter_on_its_bound_is_reported_and_the_others_are_maximal() {
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let recordings = [ReadingSeries { time_s: &time_s, value: &after_the_first(), extra_sd: &[] }];
    let bounded = Parameter { name: "level", start: 2500.0, lower: 2000.0, upper: 1e5 };
    let parameters = [Parameter::around("reading", 1e4), bounded];
    let likelihood = Likelihood::<_, 1, 1> { family: &LocalLevel, parameters: &parameters, recordings: &recordings };
    let fit = likelihood.fit().unwrap();
    let [reading, level] = &fit.parameters[..] else { unreachable!() };
    assert_eq!((level.bound, level.standard_error), (Some(Bound::Lower), None));
    assert_close(level.value, 2000.0, 1e-12, "bound");
    assert!(fit.converged && reading.bound.is_none() && reading.standard_error.is_some());
    // The likelihood falls on both sides of the other parameter.
    let at = |value: f64| likelihood.log_likelihood(&[value, level.value]).unwrap().value;
    assert!(at(reading.value) > at(reading.value * 1.001) && at(reading.value) > at(reading.value * 0.999));
    // The search for an end starts at a maximum with zero slope, which a parameter on its bound does not have.
    let none = likelihood.profile_interval(&fit, 1);
    assert_eq!((none.lower, none.upper), (None, None));
    let held = likelihood.profile_interval(&fit, 0);
    assert!(held.lower.unwrap() < reading.value && reading.value < held.upper.unwrap());
}
