use super::*;
use crate::samples::Samples;
use ohmstrain_model::{Gauge, StrainRange};
use ohmstrain_sensor::{LawParams, SensorParams};

const SENSOR: &str = include_str!("../../tests/fixtures/representative.toml");
const REST_OHM: f64 = 1700.0;
const SPAN: f64 = 0.3;
const RANGE: StrainRange<f64> = StrainRange { lower: 0.0, upper: SPAN };

/// Returns the weights of a sensor: gauge 1.8 ε - 1.2 ε², a branch of 4 s with gains 0.9 and -0.5, which grow by -1.1 and 0.6 per strain.
fn truth() -> Vec<f64> {
    let middle = 0.5 * SPAN;
    let gains = [(0.9 - 1.1 * middle) * SPAN, (-0.5 + 0.6 * middle) * SPAN, -1.1 * SPAN * SPAN, 0.6 * SPAN * SPAN];
    [&[1.8 * SPAN, -1.2 * SPAN * SPAN, 0.0, 0.0, 0.0][..], &gains].concat()
}

fn prior(mean: Vec<f64>, variance: f64) -> LawPrior {
    let size = mean.len();
    let covariance = (0..size).map(|i| (0..size).map(|j| if i == j { variance } else { 0.0 }).collect()).collect();
    LawPrior { range: RANGE, tau_s: vec![4.0], error_density_s: 1e-4, mean, covariance }
}

/// Simulates that sensor's readings, by small Euler steps between rows 0.1 s apart.
fn recording() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    const STEPS: u32 = 2000;
    let row = |k: u32| 0.15 - 0.15 * (0.05 * f64::from(k)).cos() * (0.013 * f64::from(k)).cos();
    let (mut time_s, mut ohm, mut strain) = (vec![], vec![], vec![]);
    let mut relaxing = 0.0;
    for k in 0..400 {
        let (now, next) = (row(k), row(k + 1));
        time_s.push(0.1 * f64::from(k));
        ohm.push(REST_OHM * (1.0 + 1.8 * now - 1.2 * now * now + relaxing));
        strain.push(now);
        let dt_s = 0.1 / f64::from(STEPS);
        for step in 0..STEPS {
            let at = now + (next - now) * (f64::from(step) + 0.5) / f64::from(STEPS);
            let gain = if next > now { 0.9 - 1.1 * at } else { -0.5 + 0.6 * at };
            relaxing += dt_s * (-relaxing / 4.0 + gain * (next - now) / 0.1);
        }
    }
    (time_s, ohm, strain)
}

fn fitted(prior: &LawPrior) -> (LawParams, f64) {
    let (time_s, ohm, strain) = recording();
    let fit = prior.posterior(&[Samples::new(&time_s, &ohm, &strain).unwrap()]).unwrap().law;
    (fit.law, fit.rest_readings[0])
}

fn gauge(law: &LawParams) -> [f64; 3] {
    let Gauge::Polynomial { coefficients } = law.gauge else { panic!("{:?}", law.gauge) };
    coefficients
}

/// The fit takes a gain at the middle strain of a row, which is exact to the square of a step, 1e-4. The remaining differences are
/// rounding, the Euler steps (1/2000 of a row) and the passes for R₀.
#[test]
fn a_prior_of_infinite_spread_leaves_the_recording_alone() {
    let (law, rest) = fitted(&prior(vec![0.7; 9], 1e8));
    let [a, b, c] = gauge(&law);
    assert!((rest / REST_OHM - 1.0).abs() < 1e-3, "{rest}");
    assert!((a - 1.8).abs() < 5e-3 && (b + 1.2).abs() < 3e-2 && c.abs() < 0.1, "{law:?}");
    let branch = law.branches[0];
    assert!((branch.extend_gain - 0.9).abs() < 5e-3 && (branch.retract_gain + 0.5).abs() < 5e-3, "{branch:?}");
    assert!((branch.extend_gain_slope + 1.1).abs() < 3e-2 && (branch.retract_gain_slope - 0.6).abs() < 3e-2);
}

#[test]
fn a_prior_of_no_spread_wins() {
    let mean: Vec<f64> = truth().iter().map(|weight| 1.25 * weight).collect();
    let (law, _) = fitted(&prior(mean, 1e-16));
    let [a, b, c] = gauge(&law);
    assert!((a - 1.25 * 1.8).abs() < 1e-6 && (b + 1.25 * 1.2).abs() < 1e-6 && c.abs() < 1e-5, "{law:?}");
    assert!((law.branches[0].extend_gain - 1.25 * 0.9).abs() < 1e-6);
}

/// Tests R₀: with the right mean it is that of the recording, however tight the prior, from a median reading that is a third larger.
#[test]
fn the_resistance_at_rest_is_the_sensors_own() {
    for variance in [1e-12, 1e-4, 1.0] {
        let (_, rest) = fitted(&prior(truth(), variance));
        assert!((rest / REST_OHM - 1.0).abs() < 1e-3, "{variance}: {rest}");
    }
}

fn sensor() -> SensorParams {
    toml::from_str(SENSOR).unwrap()
}

/// Returns a sensor whose resistance changes are larger by `factor`.
fn scaled(factor: f64) -> SensorParams {
    let mut sensor = sensor();
    let law = &mut sensor.law;
    let Gauge::Polynomial { coefficients } = &mut law.gauge else { panic!("a polynomial") };
    coefficients.iter_mut().for_each(|c| *c *= factor);
    law.extend_viscosity_s *= factor;
    law.retract_viscosity_s *= factor;
    for branch in &mut law.branches {
        branch.extend_gain *= factor;
        branch.retract_gain *= factor;
        branch.extend_gain_slope *= factor;
        branch.retract_gain_slope *= factor;
    }
    sensor.uncertainty = None;
    sensor
}

/// Tests gains of 0.8, 1 and 1.2 times a law: the mean is its weights, the variance (0.2 of them)², plus 1/3 of that for the mean.
#[test]
fn mean_and_spread_are_those_of_the_sensors() {
    let prior = Prior::learn(&[scaled(0.8), scaled(1.2), scaled(1.0)], "test").unwrap();
    let Gauge::Polynomial { coefficients } = sensor().law.gauge else { panic!("a polynomial") };
    let span = prior.law.range.span();
    let taus: Vec<f64> = sensor().law.branches.iter().map(|branch| branch.tau_s).collect();
    assert_eq!(prior.law.tau_s, taus);
    for (i, coefficient) in coefficients.iter().enumerate() {
        let expected = coefficient * span.powi(i as i32 + 1);
        // The normal equations are regularised by a millionth; collinear columns turn that into at most a hundredth.
        let tolerance = 1e-2 * prior.law.mean.iter().map(|x| x.abs()).fold(0.0, f64::max);
        assert!((prior.law.mean[i] - expected).abs() < tolerance, "{i}: {} {expected}", prior.law.mean[i]);
        let variance = prior.law.covariance[i][i] - (0.01 * prior.law.mean[i]).powi(2).max(1e-8);
        let expected = (0.2 * prior.law.mean[i]).powi(2) * (1.0 + 1.0 / 3.0);
        assert!((variance - expected).abs() < 1e-6 * expected, "{i}: {variance} {expected}");
    }
}

#[test]
fn what_is_written_is_read_and_checked() {
    let prior = Prior::learn(&[scaled(0.8), scaled(1.2), scaled(1.0)], "test").unwrap();
    prior.validate().unwrap();
    let text = toml::to_string(&prior).unwrap();
    assert_eq!(toml::from_str::<Prior>(&text).unwrap(), prior);
    let broken = |change: fn(&mut Prior)| {
        let mut prior = prior.clone();
        change(&mut prior);
        prior.validate().unwrap_err().field
    };
    assert_eq!(broken(|prior| prior.sensors = 2), "sensors");
    assert_eq!(broken(|prior| prior.law.mean[1] = f64::NAN), "law.mean[1]");
    assert_eq!(broken(|prior| prior.law.covariance[0][0] = -1.0), "law.covariance");
    assert_eq!(broken(|prior| prior.law.covariance[1][0] += 1.0), "law.covariance");
    assert_eq!(broken(|prior| prior.law.mean.truncate(3)), "law.mean");
    let no_spread = |prior: &mut Prior| prior.estimators.values_mut().for_each(|one| one.ln_sd[0] = 0.0);
    assert_eq!(broken(no_spread), "estimators.ekf.ln_sd[0]");
    assert!(Prior::learn(&[scaled(1.0), scaled(1.1)], "test").is_err());
}

/// Compares with the normal density, -1/2 (x - m)²/s², over 40 s / (2 × 8 s) independent errors.
#[test]
fn noise_is_pulled_by_the_density_of_the_prior() {
    let prior = EstimatorPrior {
        ln_mean: vec![0.0, 8.0_f64.ln(), 0.0, 0.0, 0.0, 0.0, 0.0],
        ln_sd: vec![0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 0.25],
        reading_time_s: 0.0,
        strain_mean: 0.1,
        reversal: 0.0,
        strain_sd_scale: 1.0,
    };
    let mut point = prior.ln_mean.clone();
    point[0] += 1.0;
    point[6] -= 0.5;
    assert!((prior.pull(&point, 40.0) - 0.5 * (4.0 + 4.0) / 2.5).abs() < 1e-12);
    assert_eq!(prior.pull(&prior.ln_mean, 40.0), 0.0);
}
