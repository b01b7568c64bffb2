//! Advice in cases with known right advice, the table of structures, and the block bootstrap.

use ohmstrain_calib::likelihood::Bound;
use ohmstrain_calib::{GaugeFamily, Identifiability, LawOptions, bootstrap_law, compare_structures, identifiability};
use ohmstrain_model::{Branch, Gauge, StrainRange};
use ohmstrain_sensor::LawParams;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::bench::Bench;

const STEP_S: f64 = 0.1;

fn law(tau_s: f64) -> LawParams {
    let branch = Branch { tau_s, extend_gain: 0.5, retract_gain: 0.3, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
    LawParams {
        extend_viscosity_s: 0.3,
        retract_viscosity_s: 0.1,
        range: StrainRange { lower: 0.0, upper: 0.3 },
        gauge: Gauge::Polynomial { coefficients: [1.8, -1.1, 0.0] },
        branches: vec![branch],
    }
}

/// Returns a strain that moves from one target to the next: target, speed per second, hold in seconds.
fn path(legs: &[(f64, f64, f64)]) -> Vec<f64> {
    let mut strain = vec![0.0];
    let mut at = 0.0_f64;
    for &(target, speed, hold_s) in legs {
        let rows = ((target - at).abs() / speed / STEP_S).round();
        strain.extend((1..=rows as usize).map(|k| at + (target - at) * k as f64 / rows));
        strain.extend(vec![target; (hold_s / STEP_S) as usize]);
        at = target;
    }
    strain
}

/// Returns a recording of a sensor with one branch, for a strain that is linear between rows, with correlated noise of
/// `sd`.
fn record(law: &LawParams, strain: Vec<f64>, sd: f64, seed: u64) -> Bench {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let Gauge::Polynomial { coefficients: [a, b, _] } = law.gauge else { unreachable!() };
    let branch = law.branches[0];
    let (mut relaxation, mut noise) = (0.0, 0.0);
    let mut reading = Vec::new();
    for k in 0..strain.len() {
        let change = if k == 0 { 0.0 } else { strain[k] - strain[k - 1] };
        let gain = if change > 0.0 { branch.extend_gain } else { branch.retract_gain };
        let x = STEP_S / branch.tau_s;
        relaxation = relaxation * (-x).exp() + gain * change * (1.0 - (-x).exp()) / x;
        let viscosity = if change > 0.0 { law.extend_viscosity_s } else { law.retract_viscosity_s };
        let shock: f64 = StandardNormal.sample(&mut rng);
        noise = 0.7 * noise + sd * (1.0_f64 - 0.49).sqrt() * shock;
        let rho = a * strain[k] + b * strain[k] * strain[k] + viscosity * change / STEP_S + relaxation + noise;
        reading.push(1500.0 * (1.0 + rho));
    }
    Bench { time_s: (0..strain.len()).map(|k| k as f64 * STEP_S).collect(), reading, strain }
}

fn examined(law: &LawParams, strain: Vec<f64>, sd: f64) -> Identifiability {
    identifiability(&[record(law, strain, sd, 1).samples()], law).unwrap()
}

#[test]
fn one_speed_hides_the_dash_pot_and_a_second_one_shows_it() {
    let legs = |speeds: [f64; 2]| {
        let cycle = |k: usize| [(0.3, speeds[k % 2], 0.0), (0.0, speeds[k % 2], 0.0)];
        path(&(0..12).flat_map(cycle).collect::<Vec<_>>())
    };
    let one = examined(&law(4.0), legs([0.03, 0.03]), 1e-3);
    let two = examined(&law(4.0), legs([0.03, 0.09]), 1e-3);
    let advises_second_speed =
        |found: &Identifiability| found.advice.iter().any(|line| line.contains("at a second speed"));
    assert!(advises_second_speed(&one), "{one}");
    assert!(!advises_second_speed(&two), "{two}");
    assert!(one.condition_number > 100.0 * two.condition_number, "{one}{two}");
    // The errors agree. At one speed, only the rows in which it turns around distinguish the dash-pot from R₀.
    let error = |found: &Identifiability, name: &str| {
        let at = found.parameters.names.iter().position(|known| known == name).unwrap();
        found.parameters.standard_errors[at]
    };
    assert!(error(&one, "extend_viscosity_s") > 2.0 * error(&two, "extend_viscosity_s"), "{one}{two}");
}

#[test]
fn holds_shorter_than_a_time_constant_are_asked_to_be_longer() {
    let legs = |hold_s: f64, cycles: usize| {
        let cycle = |k: usize| {
            let speed = [0.02, 0.06][k % 2];
            [(0.3, speed, hold_s), (0.05, speed, hold_s)]
        };
        path(&(0..cycles).flat_map(cycle).collect::<Vec<_>>())
    };
    let about_holds = |found: &Identifiability| -> Vec<String> {
        found.advice.iter().filter(|line| line.contains("hold")).cloned().collect()
    };
    let short = examined(&law(60.0), legs(8.0, 6), 2e-2);
    let [line] = &about_holds(&short)[..] else { panic!("{short}") };
    assert!(
        line.starts_with("hold at the largest strain for ") && line.contains(", release, and rest for "),
        "{short}"
    );
    let long = examined(&law(60.0), legs(150.0, 6), 1e-3);
    assert!(about_holds(&long).is_empty(), "{long}");
    let tau = long.parameters.names.iter().position(|name| name == "branches[0].tau_s").unwrap();
    assert!((long.parameters.values[tau] / 60.0 - 1.0).abs() < 0.1, "{long}");
}

#[test]
fn a_time_constant_beyond_the_recording_ends_on_its_bound() {
    let cycle = |k: usize| {
        let speed = [0.02, 0.06][k % 2];
        [(0.3, speed, 12.0), (0.0, speed, 12.0)]
    };
    let found = examined(&law(400.0), path(&(0..4).flat_map(cycle).collect::<Vec<_>>()), 1e-4);
    let [on] = &found.on_bound[..] else { panic!("{found}") };
    assert_eq!((on.name.as_str(), on.bound), ("branches[0].tau_s", Bound::Upper));
    assert!(
        found.advice.iter().any(|line| line.starts_with("hold at") && line.ends_with("the longest hold was 12 s")),
        "{found}"
    );
}

#[test]
fn a_rest_resistance_far_from_what_was_recorded_is_an_extrapolation() {
    let mut strain =
        path(&(0..8).flat_map(|k| [(0.2, [0.02, 0.06][k % 2], 5.0), (0.0, 0.03, 5.0)]).collect::<Vec<_>>());
    for strain in &mut strain {
        *strain += 0.1;
    }
    let found = examined(&law(4.0), strain, 1e-3);
    assert!(found.advice.iter().any(|line| line.contains("near zero strain")), "{found}");
}

fn wandering() -> Bench {
    let legs: Vec<_> = (0..14)
        .flat_map(|k| {
            let (top, speed) = ([0.3, 0.2, 0.25][k % 3], [0.02, 0.06, 0.1, 0.04][k % 4]);
            [(top, speed, 6.0), ([0.0, 0.05][k % 2], speed, 6.0)]
        })
        .collect();
    record(&law(4.0), path(&legs), 2e-3, 5)
}

#[test]
fn correlations_are_correlations() {
    let found = identifiability(&[wandering().samples()], &law(4.0)).unwrap();
    for (i, row) in found.correlation.iter().enumerate() {
        assert_eq!(row[i], 1.0);
        for (j, correlation) in row.iter().enumerate() {
            // Symmetric up to the rounding of a product of three matrices of a dozen columns.
            assert!(correlation.abs() <= 1.0 + 1e-9 && (correlation - found.correlation[j][i]).abs() < 1e-6);
        }
    }
    assert!(found.condition_number > 1.0 && found.condition_number.is_finite());
    let text = found.to_string();
    assert!(text.contains("gauge.coefficients[0]") && text.contains("what to record next"), "{text}");
}

#[test]
fn the_structure_that_made_the_recording_scores_best_among_fewer_branches() {
    let scores = compare_structures(&[wandering().samples()]).unwrap();
    let at = |branches: usize, gauge: GaugeFamily| {
        *scores.iter().find(|score| score.options == LawOptions { branches, gauge }).unwrap()
    };
    let (none, one) = (at(0, GaugeFamily::Polynomial), at(1, GaugeFamily::Polynomial));
    assert!(one.aic < none.aic && one.bic < none.bic, "{scores:?}");
    // Constant, cubic, dash-pot; the branch adds four gains and its time constant.
    assert_eq!((none.parameters, one.parameters), (6, 11));
    // Schwarz penalises a parameter more than Akaike, so the richest structure gains less.
    let three = at(3, GaugeFamily::Polynomial);
    assert!(three.bic - one.bic > three.aic - one.aic, "{scores:?}");
}

#[test]
fn the_bootstrap_repeats_with_its_seed_and_agrees_with_the_jackknife() {
    let bench = wandering();
    let drawn = |seed: u64| bootstrap_law(&[bench.samples()], &law(4.0), 60, seed).unwrap();
    let (one, same, other) = (drawn(7), drawn(7), drawn(8));
    assert_eq!(one, same);
    assert_ne!(one, other);
    let found = identifiability(&[bench.samples()], &law(4.0)).unwrap().parameters;
    assert_eq!((one.replicates, &one.names, &one.values), (60, &found.names, &found.values));
    for (i, name) in one.names.iter().enumerate() {
        let width = (one.upper[i] - one.lower[i]) / (2.0 * 1.96 * found.standard_errors[i]);
        // Two estimates of one width, each from forty blocks and thus accurate to 1/√80 = 11 %, and percentiles of
        // sixty draws, accurate to about 15 %: four deviations of both together are 0.75.
        assert!((0.5..=1.75).contains(&width), "{name}: {width}");
    }
}

#[test]
fn a_time_constant_on_its_bound_does_not_hold_up_the_other() {
    let mut slow = law(4.0);
    slow.branches.push(Branch { tau_s: 400.0, ..slow.branches[0] });
    // A quarter of the recording is shorter than 400 s, so the second time constant ends on its bound.
    let bench = wandering();
    let from = |tau_s: f64| {
        let mut start = slow.clone();
        start.branches[0].tau_s = tau_s;
        identifiability(&[bench.samples()], &start).unwrap()
    };
    let (near, far) = (from(4.0), from(9.0));
    let tau = near.parameters.names.iter().position(|name| name == "branches[0].tau_s").unwrap();
    let (value, error) = (near.parameters.values[tau], near.parameters.standard_errors[tau]);
    // The same minimum from both starts, to a small fraction of its standard error.
    assert!((value - far.parameters.values[tau]).abs() < 0.05 * error, "{near}{far}");
}
