//! The likelihood on readings alone: the Nile as other programs have it, and expectation maximisation beside it.

use nalgebra::{matrix, vector};
use ohmstrain_calib::likelihood::{
    Bound, EmStart, Likelihood, LinearModel, ModelFamily, Parameter, Readings, expectation_maximisation,
};
use ohmstrain_ekf::{Belief, DiffuseBelief};
use ohmstrain_model::{ParameterError, Scalar, Symmetric};

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

/// Maximum, standard errors and profile intervals of the local level model with an exact diffuse start; made by
/// statsmodels and an independent implementation (`nile.json`), in accord with the published 15099 / 1469.1 / -632.54.
mod published {
    pub const MAXIMUM: [f64; 2] = [15098.519468532784, 1469.1760283280664];
    pub const FIRST_CONSUMED: f64 = -632.5456251030405;
    pub const CONSTANT_COUNTED: f64 = -633.4645636362452;
    pub const STANDARD_ERRORS: [f64; 2] = [3145.5479741180607, 1280.3751272019597];
    pub const LN_STANDARD_ERRORS: [f64; 2] = [0.20833486074718002, 0.8714920038366514];
    pub const PROFILES: [[f64; 2]; 2] = [[9618.798036080254, 22123.418574553514], [252.4703673964374, 5984.9562037585]];
    /// Iteration, log-likelihood, variance of readings and of the level, from a start a₁ = 0, P₁ = 1e7 that stays.
    pub const EM: [[f64; 4]; 10] = [
        [0.0, -911.2615735179558, 1000.0, 1000.0],
        [1.0, -652.8837705018052, 5691.310714712476, 3778.3394407682717],
        [2.0, -644.2802745250535, 8781.91109683834, 4449.908830258724],
        [5.0, -642.6014964182749, 11872.768624684564, 4256.485799308769],
        [10.0, -642.2312585803999, 12721.248615315311, 3542.8086377094296],
        [20.0, -641.8806603512149, 13516.176882897893, 2727.6994275192524],
        [50.0, -641.628315281055, 14508.44837593483, 1881.3262154638853],
        [100.0, -641.5881852979046, 14955.378597840785, 1563.2289138227613],
        [500.0, -641.5855783460885, 15099.682181240642, 1468.5026994233492],
        [3000.0, -641.5855783460869, 15099.68589140103, 1468.5003126850713],
    ];
}

struct LocalLevel;

impl ModelFamily<1, 1> for LocalLevel {
    type Model<T: Scalar> = LinearModel<T, 1, 1>;

    fn model<T: Scalar>(&self, parameters: &[T]) -> Result<Self::Model<T>, ParameterError> {
        Ok(LinearModel {
            transition: matrix![T::one()],
            noise: Symmetric::from_diagonal(&[parameters[1]]),
            gradient: vector![T::one()],
            variance: parameters[0],
        })
    }

    fn start<T: Scalar>(&self, _: &Self::Model<T>) -> DiffuseBelief<T, 1, 1> {
        DiffuseBelief::new(Belief::independent(vector![T::zero()], &[T::zero()]), &[T::one()])
    }
}

fn assert_close(got: f64, expected: f64, relative: f64, what: &str) {
    assert!((got / expected - 1.0).abs() <= relative, "{what}: {got} vs {expected}");
}

#[test]
fn the_nile() {
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let parameters = [Parameter::around("reading", 5e3), Parameter::around("level", 5e3)];
    let recordings = [Readings { time_s: &time_s, value: &NILE, extra_sd: &[] }];
    let likelihood = Likelihood::<_, 1, 1> { family: &LocalLevel, parameters: &parameters, recordings: &recordings };
    let fit = likelihood.fit().unwrap();
    assert!(fit.converged && fit.gradient_norm < 1e-8, "{fit:?}");
    // Both programs stop where the likelihood no longer rises in double precision: a flat maximum, 1e-8 standard errors
    // of rounding in ln θ for us and 1e-7 for a search without derivatives.
    assert_close(fit.log_likelihood.value, published::CONSTANT_COUNTED, 1e-13, "log-likelihood");
    assert_close(fit.log_likelihood.without_constant, published::FIRST_CONSUMED, 1e-13, "without the constant");
    for (i, parameter) in fit.parameters.iter().enumerate() {
        assert_close(parameter.value, published::MAXIMUM[i], 1e-6, "maximum");
        assert_close(parameter.standard_error.unwrap(), published::STANDARD_ERRORS[i], 1e-5, "standard error");
        assert_close(parameter.ln_standard_error.unwrap(), published::LN_STANDARD_ERRORS[i], 1e-5, "log scale");
        let [lower, upper] = published::PROFILES[i];
        for interval in [likelihood.profile_interval(&fit, i).unwrap(), likelihood.newton_profile_interval(&fit, i)] {
            assert_close(interval.lower.unwrap(), lower, 1e-6, "lower end");
            assert_close(interval.upper.unwrap(), upper, 1e-6, "upper end");
        }
    }
}

#[test]
fn the_start_of_the_search_does_not_matter() {
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let recordings = [Readings { time_s: &time_s, value: &NILE, extra_sd: &[] }];
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
    let recordings = [Readings { time_s: &time_s, value: &NILE, extra_sd: &[] }];
    let bounded = Parameter { name: "level", start: 2500.0, lower: 2000.0, upper: 1e5 };
    let parameters = [Parameter::around("reading", 1e4), bounded];
    let likelihood = Likelihood::<_, 1, 1> { family: &LocalLevel, parameters: &parameters, recordings: &recordings };
    let fit = likelihood.fit().unwrap();
    let [reading, level] = &fit.parameters[..] else { unreachable!() };
    assert_eq!((level.bound, level.standard_error), (Some(Bound::Lower), None));
    assert_close(level.value, 2000.0, 1e-12, "bound");
    assert!(fit.converged && reading.bound.is_none() && reading.standard_error.is_some());
    // The likelihood falls to both sides of the other parameter.
    let at = |value: f64| likelihood.log_likelihood(&[value, level.value]).unwrap().value;
    assert!(at(reading.value) > at(reading.value * 1.001) && at(reading.value) > at(reading.value * 0.999));
    let interval = likelihood.profile_interval(&fit, 1).unwrap();
    assert!(interval.lower.is_none() && interval.upper.is_some());
    // The fast way starts at a maximum with no slope, which a parameter on its bound has not; the other's does not need it.
    let none = likelihood.newton_profile_interval(&fit, 1);
    assert_eq!((none.lower, none.upper), (None, None));
    let held = likelihood.newton_profile_interval(&fit, 0);
    assert!(held.lower.unwrap() < reading.value && reading.value < held.upper.unwrap());
}

#[test]
fn expectation_maximisation_goes_the_way_it_went_elsewhere() {
    let model = LinearModel {
        transition: matrix![1.0],
        noise: Symmetric::from_diagonal(&[1000.0]),
        gradient: vector![1.0],
        variance: 1000.0,
    };
    let start = EmStart { model, belief: Belief::independent(vector![0.0], &[1e7]) };
    let trace = expectation_maximisation::<1, 1>(&start, &NILE, 3000).unwrap();
    assert_eq!(trace.len(), 3001);
    for [iteration, log_likelihood, variance, noise] in published::EM {
        let at = &trace[iteration as usize];
        // Each iteration rounds once more; errors shrink as the iterations contract.
        assert_close(at.log_likelihood, log_likelihood, 1e-11, "log-likelihood");
        assert_close(at.model.variance, variance, 1e-9, "variance of readings");
        assert_close(at.model.noise[(0, 0)], noise, 1e-9, "variance of the level");
    }
    // The log-likelihood sums a hundred terms of order ten.
    assert!(trace.windows(2).all(|pair| pair[1].log_likelihood > pair[0].log_likelihood - 1e-11));
}

#[test]
fn expectation_maximisation_and_newton_agree_with_gaps() {
    struct Proper;
    impl ModelFamily<1, 1> for Proper {
        type Model<T: Scalar> = LinearModel<T, 1, 1>;
        fn model<T: Scalar>(&self, parameters: &[T]) -> Result<Self::Model<T>, ParameterError> {
            LocalLevel.model(parameters)
        }
        fn start<T: Scalar>(&self, _: &Self::Model<T>) -> DiffuseBelief<T, 1, 1> {
            Belief::independent(vector![T::zero()], &[T::of(1e7)]).into()
        }
    }
    let time_s: Vec<f64> = (0..100).map(f64::from).collect();
    let mut value = NILE;
    value[20..40].fill(f64::NAN);
    value[60..80].fill(f64::NAN);
    let parameters = [Parameter::around("reading", 1e4), Parameter::around("level", 1e4)];
    let recordings = [Readings { time_s: &time_s, value: &value, extra_sd: &[] }];
    let likelihood = Likelihood::<_, 1, 1> { family: &Proper, parameters: &parameters, recordings: &recordings };
    let fit = likelihood.fit().unwrap();
    let model = LocalLevel.model(&[1e4, 1e4]).unwrap();
    let start = EmStart { model, belief: Belief::independent(vector![0.0], &[1e7]) };
    let trace = expectation_maximisation::<1, 1>(&start, &value, 10_000).unwrap();
    let last = trace.last().unwrap();
    // It converges linearly and creeps where half of the level is never seen.
    assert_close(last.model.variance, fit.parameters[0].value, 1e-4, "variance of readings");
    assert_close(last.model.noise[(0, 0)], fit.parameters[1].value, 1e-3, "variance of the level");
    assert!(last.log_likelihood <= fit.log_likelihood.value + 1e-10);
    assert_eq!(fit.log_likelihood.readings, 60);
}
