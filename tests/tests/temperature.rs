//! The effect of temperature, fitted to simulated sensors in a climate chamber. Their law is outside of the fitted family; their
//! temperature is behind the thermometer's, and above it by self-heating.

use ohmstrain::{Calibration, EstimatorKind, Recording, Sensor, TemperatureCoefficients, TemperatureParams};
use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::simulate::{Chamber, Material, Protocol, SimulationSettings, simulate};
use ohmstrain_calib::{Samples, TemperatureFit, fit_temperature};
use ohmstrain_tests::Draws;

/// Coefficients of the simulations, per kelvin: R₀'s and the gain's.
const COEFFICIENTS: [(f64, f64); 3] = [(0.003, -0.002), (-0.002, 0.0), (0.001, 0.003)];
const SEEDS: std::ops::RangeInclusive<u64> = 1..=4;

/// Simulates an hour in which the chamber's temperature rises and falls twice and a half.
fn recorded(chamber: Option<Chamber>, seed: u64) -> Trace {
    let protocol = Protocol::Mixed { duration_s: 3600.0 };
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        mismatched: true,
        sample_rate_hz: 2.0,
        chamber,
        seed,
        ..SimulationSettings::new(Material::Representative, protocol)
    };
    simulate(&settings).unwrap()
}

fn chamber((rest_per_k, gain_per_k): (f64, f64)) -> Chamber {
    Chamber { rest_per_k, gain_per_k, period_s: 1500.0, ..Chamber::default() }
}

fn columns(trace: &Trace) -> (Samples<'_>, &[f64]) {
    let (strain, temperature_c) = (trace.reference.as_ref().unwrap(), trace.temperature_c.as_ref().unwrap());
    (Samples::new(&trace.time_s, &trace.readings.values, &strain.values).unwrap(), temperature_c)
}

fn fit(trace: &Trace) -> TemperatureFit {
    let (samples, temperature_c) = columns(trace);
    fit_temperature(&[samples], &[temperature_c], None).unwrap()
}

/// Relative change of the median reading per kelvin: `a + b ρ/(1 + ρ)`.
fn of_median(effect: &TemperatureParams, change: f64) -> f64 {
    effect.rest_per_k + effect.gain_per_k * change / (1.0 + change)
}

/// The effect on a typical reading must be within three of its standard deviations, plus what the simulation has and the fit does not:
/// half a kelvin of self-heating that fades in, and 20 s behind, of 1500 s: less than a tenth of the effect.
#[test]
fn coefficients_are_found() {
    for seed in SEEDS {
        let without = recorded(None, seed);
        let rest = without.readings.values[0];
        let mut changes: Vec<f64> = without.readings.values.iter().map(|ohm| ohm / rest - 1.0).collect();
        changes.sort_by(f64::total_cmp);
        let change = changes[changes.len() / 2];
        for (a, b) in COEFFICIENTS {
            let found = fit(&recorded(Some(chamber((a, b))), seed)).effect.unwrap();
            assert!((found.lower_c, found.upper_c) == (10.0, 40.0) && (found.reference_c - 25.0).abs() < 1.0);
            let truth = TemperatureParams { rest_per_k: a, gain_per_k: b, ..found };
            let (found_change, true_change) = (of_median(&found, change), of_median(&truth, change));
            let sd = found.rest_per_k_sd.hypot(found.gain_per_k_sd * change / (1.0 + change));
            let apart = (found_change - true_change).abs();
            assert!(apart < 3.0 * sd + 0.1 * true_change.abs(), "seed {seed}, {a} {b}: {apart}, sd {sd}: {found:?}");
        }
    }
}

/// Tests a chamber without an effect, where none must be found, and one that only warms, whose effect cannot be told from drift.
#[test]
fn no_effect_is_found_where_there_is_none() {
    for seed in SEEDS {
        let fit = fit(&recorded(Some(chamber((0.0, 0.0))), seed));
        assert_eq!(fit.effect, None, "seed {seed}");
    }
    let warming = Chamber { period_s: 7200.0, ..Chamber::default() };
    let fit = fit(&recorded(Some(warming), 1));
    assert!(fit.effect.is_none() && fit.confounded.unwrap().own_share < 0.04, "{fit:?}");
}

/// Readings to which a known effect was added, by the formula in this test, calibrate and evaluate as those without it.
#[test]
fn a_known_effect_on_r0_is_removed_completely() {
    let trace = recorded(None, 1).rows(0..2400);
    let strain = &trace.reference.as_ref().unwrap().values;
    let temperature_c: Vec<f64> = (0..trace.len()).map(|row| 25.0 + 15.0 * (0.01 * row as f64).sin()).collect();
    let warm: Vec<f64> =
        trace.readings.values.iter().zip(&temperature_c).map(|(ohm, c)| ohm * (1.0 + 0.004 * (c - 25.0))).collect();
    let mut sorted = temperature_c.clone();
    sorted.sort_by(f64::total_cmp);
    let at_median = 1.0 + 0.004 * (sorted[sorted.len() / 2] - 25.0);
    // Per kelvin from the median, not from 25 °C.
    let given = TemperatureCoefficients { rest_per_k: (0.004 / at_median, 0.0), gain_per_k: (0.0, 0.0) };
    let still: Vec<f64> = trace.readings.values.iter().map(|ohm| at_median * ohm).collect();
    let calibration = Calibration::new().estimator(EstimatorKind::Ekf).branches(1);
    let plain = Recording::new(&trace.time_s, &still, strain).unwrap();
    let warmed = Recording::new(&trace.time_s, &warm, strain).unwrap().at_temperatures_c(&temperature_c).unwrap();
    let (expected, found) =
        (calibration.run(&[plain]).unwrap().sensor, calibration.temperature(given).run(&[warmed]).unwrap().sensor);
    assert!((found.params().rest_reading / expected.params().rest_reading - 1.0).abs() < 1e-9);
    let scores = [expected.evaluate(&plain), found.evaluate(&warmed)].map(|scores| scores.unwrap().unwrap());
    let [expected, found] = scores.map(|scores| [scores.filter.rmse_percent_fs, scores.smoother.rmse_percent_fs]);
    // Searches end where rounding lets them: to a thousandth.
    assert!(expected.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-3 * a), "{expected:?} {found:?}");
}

/// Without a thermometer the deviation grows to that of an effect drawn at random, temperatures and readings evenly, over the mean slope.
#[test]
fn intervals_without_a_thermometer_hold_the_effect() {
    let text = include_str!("../fixtures/representative.toml");
    let mut params = Sensor::from_toml(text).unwrap().params().clone();
    let effect = TemperatureParams {
        reference_c: 25.0,
        lower_c: 10.0,
        upper_c: 40.0,
        rest_per_k: 0.003,
        rest_per_k_sd: 0.0,
        gain_per_k: -0.002,
        gain_per_k_sd: 0.0,
    };
    params.temperature = Some(effect);
    let without = Sensor::from_params(params.clone()).unwrap().without_temperature();
    assert_eq!(without.params().temperature, None);
    let (low, high, rest) = (params.validity.reading_lower, params.validity.reading_upper, params.rest_reading);
    let draws = 100_000;
    let mut draw = Draws::new(7);
    let squares: f64 = (0..draws)
        .map(|_| {
            let (reading, celsius) = (low + (high - low) * draw.uniform(), 10.0 + 30.0 * draw.uniform());
            let change = reading / rest - 1.0;
            let above_k = celsius - 25.0;
            let read = rest * (1.0 + 0.003 * above_k) * (1.0 + change * (1.0 - 0.002 * above_k));
            (read - reading).powi(2)
        })
        .sum();
    let sd = (squares / f64::from(draws)).sqrt() * params.limits.span() / (high - low);
    let before = params.unstated.filter_sd;
    let found = (without.params().unstated.filter_sd.powi(2) - before * before).sqrt();
    // The product of both effects, 0.2 % of the reading at most, is not in the formula: a twentieth of the effect.
    assert!((found / sd - 1.0).abs() < 0.05, "{found} {sd}");
}
