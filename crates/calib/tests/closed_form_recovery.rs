//! Fits of readings whose law is written down in the test.

use ohmstrain_calib::closed_form::{
    ClosedForm, ClosedFormError, Datum, ModulusShape, Moment, Movement, fit_closed_form,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal};

/// r₀, offset, τ₀ and r₀′.
const TRUTH: [(&str, f64); 4] = [("r0", 2500.0), ("v*eta+r1", 1600.0), ("tau0_s", 8.0), ("r0_hold", 0.12)];
const DURATION_S: f64 = 10.0;

/// Simulates a stretch at `rate` and a hold of 40 s by equations 8 and 9 as printed, with v η + r₁ = `offset`.
fn session(rate: f64, offset: f64, noise: &mut impl FnMut() -> f64) -> Vec<Datum> {
    let (r0, tau_s, fraction) = (TRUTH[0].1, TRUTH[2].1, TRUTH[3].1);
    let before = Movement { duration_s: DURATION_S, travel: rate * DURATION_S };
    let end = r0 * (-DURATION_S / tau_s).exp() * rate * DURATION_S + offset;
    let mut out = Vec::new();
    for i in 0..100 {
        let t = 0.1 * f64::from(i);
        let at = Moment { elapsed_s: t, travel: rate * t, rate, strain: rate * t, before: None };
        out.push(Datum { at, reading: r0 * (-t / tau_s).exp() * rate * t + offset + noise() });
    }
    for i in 0..200 {
        let t = 0.2 * f64::from(i);
        let at = Moment { elapsed_s: t, travel: 0.0, rate, strain: rate * DURATION_S, before: Some(before) };
        out.push(Datum { at, reading: fraction * end * (-t / tau_s).exp() + end * (1.0 - fraction) + noise() });
    }
    out
}

fn gaussian(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, 0.5).unwrap();
    move || normal.sample(&mut random)
}

#[test]
fn intervals_cover_the_truth() {
    const SEEDS: u64 = 200;
    let law = ClosedForm::Eq8And9.law(ModulusShape::SINGLE, false, f64::NAN);
    let mut covered = [0.0; 4];
    for seed in 0..SEEDS {
        let fit = fit_closed_form(law.as_ref(), &session(0.03, TRUTH[1].1, &mut gaussian(seed))).unwrap();
        assert!(fit.converged);
        for (count, (name, truth)) in covered.iter_mut().zip(TRUTH) {
            let found = fit.get(name).unwrap();
            // 296 degrees of freedom: Student's quantile is 1.968.
            *count += f64::from((found.value - truth).abs() <= 1.968 * found.standard_error.unwrap());
        }
    }
    // A binomial count of n = 200 at 0.95 has the standard deviation √(200 · 0.95 · 0.05) = 3.1. Four parameters are tested, so the
    // tolerance is four of them: less than 1 in 4000 by chance.
    let n = SEEDS as f64;
    for (count, (name, _)) in covered.iter().zip(TRUTH) {
        assert!((count - 0.95 * n).abs() <= 4.0 * (n * 0.95 * 0.05_f64).sqrt(), "{name}: {count}");
    }
}

#[test]
fn several_speeds_tell_the_dash_pot_from_the_offset() {
    let (eta, r1) = (300.0, 1500.0);
    let mut noise = gaussian(1);
    let data: Vec<Datum> =
        [0.02, 0.05].into_iter().flat_map(|rate| session(rate, rate * eta + r1, &mut noise)).collect();
    let law = ClosedForm::Eq8And9.law(ModulusShape::SINGLE, true, f64::NAN);
    let fit = fit_closed_form(law.as_ref(), &data).unwrap();
    for (name, truth) in [("eta", eta), ("r1", r1), TRUTH[0], TRUTH[2], TRUTH[3]] {
        let found = fit.get(name).unwrap();
        // A normal deviate is within 4 of its standard deviations except for 1 in 16 000.
        assert!((found.value - truth).abs() < 4.0 * found.standard_error.unwrap(), "{name}: {found:?}");
    }
}

#[test]
fn at_one_speed_they_are_not_distinguished() {
    let data = session(0.03, TRUTH[1].1, &mut gaussian(1));
    let law = ClosedForm::Eq8And9.law(ModulusShape::SINGLE, true, f64::NAN);
    let fit = fit_closed_form(law.as_ref(), &data).unwrap();
    assert_eq!(fit.get("eta").unwrap().standard_error, None);
    assert_eq!(fit.get("r1").unwrap().standard_error, None);
    assert!(fit.get("tau0_s").unwrap().standard_error.is_some());
    assert!(fit.get("r1_hold").unwrap().standard_error.is_none());
}

/// A straight line has no time constant: the fitted one ends on its limit, which is reported.
#[test]
fn a_time_constant_that_is_not_there_has_no_error() {
    let mut noise = gaussian(1);
    let datum = |i: i32| {
        let at = Moment { elapsed_s: f64::from(i), ..Moment::default() };
        Datum { at, reading: 2000.0 - f64::from(i) + 1e-3 * noise() }
    };
    let data: Vec<Datum> = (0..100).map(datum).collect();
    let law = ClosedForm::Eq9.law(ModulusShape::SINGLE, false, f64::NAN);
    let fit = fit_closed_form(law.as_ref(), &data).unwrap();
    let tau = fit.get("tau0_s").unwrap();
    assert!(tau.at_limit && tau.standard_error.is_none(), "{tau:?}");
    assert!(fit.r_squared > 0.99);
}

#[test]
fn information_criteria_choose_the_law_that_made_the_readings() {
    let mut noise = gaussian(3);
    let datum = |i: i32| {
        let t = 0.1 * f64::from(i);
        let at = Moment { elapsed_s: t, ..Moment::default() };
        Datum { at, reading: 1500.0 + 80.0 * (-t / 1.5).exp() + 60.0 * (-t / 20.0).exp() + noise() }
    };
    let data: Vec<Datum> = (0..600).map(datum).collect();
    let bic =
        |law: ClosedForm| fit_closed_form(law.law(ModulusShape::SINGLE, false, 1500.0).as_ref(), &data).unwrap().bic;
    let best = bic("eq1".parse().unwrap());
    // Equation 1 is a Prony series of two terms in other parameters.
    assert!((best - bic("prony:2".parse().unwrap())).abs() < 1e-6);
    for worse in ["eq2", "eq6", "eq9", "kww", "prony:1", "prony:3"] {
        assert!(best < bic(worse.parse().unwrap()), "{worse}");
    }
}

#[test]
fn names_of_laws_are_read_and_written() {
    for name in ["eq1", "eq2", "eq5:3", "eq6", "eq8", "eq9", "eq8+eq9", "kww", "prony:4", "tunnelling"] {
        assert_eq!(name.parse::<ClosedForm>().unwrap().to_string(), name);
    }
    for wrong in ["eq3", "prony:0", "prony:5", "prony:", "eq1:2", "", "eq8+9"] {
        assert!(wrong.parse::<ClosedForm>().is_err(), "{wrong}");
    }
}

#[test]
fn too_few_readings_and_numbers_that_are_none_are_errors() {
    let law = ClosedForm::Eq9.law(ModulusShape::SINGLE, false, f64::NAN);
    let datum = |elapsed_s: f64, reading: f64| Datum { at: Moment { elapsed_s, ..Moment::default() }, reading };
    let few: Vec<Datum> = (0..4).map(|i| datum(f64::from(i), 1.0)).collect();
    assert_eq!(fit_closed_form(law.as_ref(), &few), Err(ClosedFormError::TooFewRows { found: 4, needed: 5 }));
    let infinite: Vec<Datum> = (0..9).map(|i| datum(f64::from(i), f64::INFINITY)).collect();
    assert_eq!(fit_closed_form(law.as_ref(), &infinite), Err(ClosedFormError::NotFinite));
    let constant: Vec<Datum> = (0..9).map(|i| datum(f64::from(i), 7.0)).collect();
    let fit = fit_closed_form(law.as_ref(), &constant).unwrap();
    assert!(fit.r_squared == 0.0 && fit.parameters.iter().all(|found| found.value.is_finite()));
}
