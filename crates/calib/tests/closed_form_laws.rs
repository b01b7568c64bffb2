//! The closed forms against the printed formulas, and their gradients against finite differences.

use ohmstrain_calib::closed_form::{
    ClosedForm, Datum, ModulusShape, Moment, Movement, SeparableLaw, value_and_gradient,
};

const WITH_FLOOR: ModulusShape = ModulusShape { terms: 1, floor: true };
const TWO_TERMS: ModulusShape = ModulusShape { terms: 2, floor: true };

fn law(of: ClosedForm, modulus: ModulusShape, several_speeds: bool) -> Box<dyn SeparableLaw> {
    of.law(modulus, several_speeds, 1600.0)
}

fn moving(elapsed_s: f64) -> Moment {
    Moment { elapsed_s, travel: 0.02 * elapsed_s, rate: 0.02, strain: 0.05 + 0.02 * elapsed_s, before: None }
}

fn holding(elapsed_s: f64) -> Moment {
    let before = Some(Movement { duration_s: 7.0, travel: 0.14 });
    Moment { elapsed_s, travel: 0.0, rate: 0.02, strain: 0.19, before }
}

/// A law, its weights, its θ, a moment and the reading as printed. A modulus with a floor has κ = r₀/r₀′ = 900/0.1 and
/// r₀ E∞ as weights, r₀′ Eᵢ among the θ.
type Case = (Box<dyn SeparableLaw>, Vec<f64>, Vec<f64>, Moment, f64);

fn cases() -> Vec<Case> {
    let t = 3.7_f64;
    let (at, held) = (moving(t), holding(t));
    let e = |tau: f64| (-t / tau).exp();
    let end = |tau: f64| (-7.0 / tau).exp();
    let travel = 0.02 * t;
    let start = 900.0 * end(5.0) * 0.14 + 1500.0;
    let start_floor = 900.0 * (0.3 + 0.7 * end(5.0)) * 0.14 + 0.02 * 40.0 + 1500.0;
    let two = |at: fn(f64, f64) -> f64| 0.5 * at(0.0, 2.0) + 0.3 * at(0.0, 11.0) + 0.2;
    let start_two = 900.0 * two(|_, tau| (-7.0 / tau).exp()) * 0.14 + 1500.0;
    vec![
        (
            law(ClosedForm::Eq1, ModulusShape::SINGLE, false),
            vec![1500.0, 80.0, 40.0],
            vec![0.9, 0.05],
            at,
            1500.0 + 80.0 * (-0.9 * t).exp() + 40.0 * (-0.05 * t).exp(),
        ),
        (
            law(ClosedForm::Eq2, ModulusShape::SINGLE, false),
            vec![0.1, 0.2, -1e-3],
            vec![6.0],
            at,
            1600.0 * (1.0 + 0.1 + 0.2 * e(6.0) - 1e-3 * t),
        ),
        (
            law(ClosedForm::Eq5 { terms: 2 }, ModulusShape::SINGLE, false),
            vec![70.0, 30.0],
            vec![2.0, 9.0],
            at,
            70.0 * e(2.0) + 30.0 * e(9.0),
        ),
        (law(ClosedForm::Eq6, ModulusShape::SINGLE, false), vec![1400.0, 70.0], vec![2.0], at, 70.0 * (e(2.0) + 20.0)),
        (
            law(ClosedForm::Eq7 { terms: 1 }, ModulusShape::SINGLE, false),
            vec![1400.0, 70.0],
            vec![2.0],
            at,
            1400.0 + 70.0 * e(2.0),
        ),
        (
            law(ClosedForm::Kww, ModulusShape::SINGLE, false),
            vec![1400.0, 70.0],
            vec![2.0, 0.4],
            at,
            1400.0 + 70.0 * (-(t / 2.0).powf(0.4)).exp(),
        ),
        (
            law(ClosedForm::Tunnelling, ModulusShape::SINGLE, false),
            vec![1600.0],
            vec![3.0, 1.5, -4.0],
            at,
            1600.0 * (1.0 + 3.0 * at.strain) * (1.5 * at.strain - 4.0 * at.strain.powi(2)).exp(),
        ),
        (
            law(ClosedForm::Eq8, ModulusShape::SINGLE, true),
            vec![900.0, 40.0, 1500.0],
            vec![5.0],
            at,
            900.0 * e(5.0) * travel + 0.02 * 40.0 + 1500.0,
        ),
        (
            law(ClosedForm::Eq8, TWO_TERMS, false),
            vec![300.0, 200.0, 100.0, 1500.0],
            vec![2.0, 11.0],
            at,
            (300.0 * e(2.0) + 200.0 * e(11.0) + 100.0) * travel + 1500.0,
        ),
        (
            law(ClosedForm::Eq9, ModulusShape::SINGLE, false),
            vec![1500.0, 150.0],
            vec![5.0],
            held,
            0.1 * 1500.0 * e(5.0) + 1500.0 * 0.9,
        ),
        (
            law(ClosedForm::Eq8And9, ModulusShape::SINGLE, false),
            vec![900.0, 1500.0],
            vec![5.0, 0.1],
            held,
            start * (0.9 + 0.1 * e(5.0)),
        ),
        (
            law(ClosedForm::Eq8And9, WITH_FLOOR, true),
            vec![9000.0, 270.0, 40.0, 1500.0],
            vec![5.0, 0.07],
            held,
            start_floor * (0.9 + 0.1 * (0.3 + 0.7 * e(5.0))),
        ),
        (
            law(ClosedForm::Eq8And9, TWO_TERMS, false),
            vec![9000.0, 180.0, 1500.0],
            vec![2.0, 11.0, 0.05, 0.03],
            held,
            start_two * (0.9 + 0.1 * (0.5 * e(2.0) + 0.3 * e(11.0) + 0.2)),
        ),
        (
            law(ClosedForm::Eq8And9, TWO_TERMS, false),
            vec![9000.0, 180.0, 1500.0],
            vec![2.0, 11.0, 0.05, 0.03],
            at,
            900.0 * (0.5 * e(2.0) + 0.3 * e(11.0) + 0.2) * travel + 1500.0,
        ),
    ]
}

#[test]
fn laws_are_as_printed() {
    for (i, (law, weights, theta, at, printed)) in cases().into_iter().enumerate() {
        let (value, _) = value_and_gradient(law.as_ref(), &weights, &theta, &at);
        // A few operations, each exact to half a unit of 2.2e-16.
        assert!((value - printed).abs() <= 1e-14 * printed.abs(), "case {i}: {value} for {printed}");
        assert_eq!(law.linear().len(), weights.len(), "case {i}");
        assert_eq!(law.nonlinear().len(), theta.len(), "case {i}");
    }
}

#[test]
fn gradients_are_slopes() {
    for (i, (law, weights, theta, at, _)) in cases().into_iter().enumerate() {
        let split = weights.len();
        let parameters = [weights, theta].concat();
        let read =
            |parameters: &[f64]| value_and_gradient(law.as_ref(), &parameters[..split], &parameters[split..], &at);
        let (value, gradient) = read(&parameters);
        for (k, slope) in gradient.iter().enumerate() {
            let step = 1e-4 * parameters[k].abs();
            let moved = |sign: f64| {
                let mut parameters = parameters.clone();
                parameters[k] += sign * step;
                read(&parameters).0
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            // Error of a central difference: rounding 2 ε |R| / 2 h, and h²/6 of the third derivative, which is at most
            // (5/p)³ of the value for the parameters p of these laws and the part of R that depends on them.
            let rounding = 4.0 * f64::EPSILON * value.abs() / step;
            let truncation = 1e-8 * 25.0 * (slope.abs() + value.abs() * 1e-3 / parameters[k].abs());
            assert!((slope - difference).abs() <= rounding + truncation, "case {i}, {k}: {slope} for {difference}");
        }
    }
}

/// These gradients propagate standard errors to derived quantities.
#[test]
fn derived_quantities_are_slopes_too() {
    let data = [moving(1.0), holding(2.0), holding(9.0)].map(|at| Datum { at, reading: 0.0 });
    let cases: Vec<(Box<dyn SeparableLaw>, Vec<f64>, usize)> = vec![
        (law(ClosedForm::Eq6, ModulusShape::SINGLE, false), vec![1400.0, 70.0, 2.0], 2),
        (law(ClosedForm::Eq8, TWO_TERMS, false), vec![300.0, 200.0, 100.0, 1500.0, 2.0, 11.0], 4),
        (law(ClosedForm::Eq9, ModulusShape::SINGLE, false), vec![1500.0, 150.0, 5.0], 2),
        (law(ClosedForm::Eq9, TWO_TERMS, false), vec![1500.0, 150.0, 70.0, 5.0, 30.0], 3),
        (law(ClosedForm::Eq8And9, ModulusShape::SINGLE, true), vec![900.0, 40.0, 1500.0, 5.0, 0.1], 3),
        (law(ClosedForm::Eq8And9, TWO_TERMS, true), vec![9000.0, 180.0, 40.0, 1500.0, 2.0, 11.0, 0.05, 0.03], 4),
    ];
    for (law, parameters, split) in cases {
        let derive = |parameters: &[f64]| law.derived(&parameters[..split], &parameters[split..], &data);
        let derived = derive(&parameters);
        assert!(!derived.is_empty());
        for (i, own) in derived.iter().enumerate() {
            for (k, slope) in own.gradient.iter().enumerate() {
                let step = 1e-4 * parameters[k].abs();
                let moved = |sign: f64| {
                    let mut parameters = parameters.clone();
                    parameters[k] += sign * step;
                    derive(&parameters)[i].value
                };
                let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                // h²/6 = 1.7e-9 p² of a third derivative of at most (10/p)³ of the value.
                let tolerance = 2e-6 * own.value.abs() / parameters[k].abs();
                assert!(
                    (slope - difference).abs() <= tolerance,
                    "{}, {k}: {slope} for {difference}",
                    own.parameter.name
                );
            }
        }
    }
}

#[test]
fn products_are_taken_apart() {
    let law = law(ClosedForm::Eq8And9, TWO_TERMS, false);
    let data = [Datum { at: holding(2.0), reading: 0.0 }];
    let derived = law.derived(&[9000.0, 180.0, 1500.0], &[2.0, 11.0, 0.05, 0.03], &data);
    let start = 900.0 * (0.5 * (-3.5_f64).exp() + 0.3 * (-7.0_f64 / 11.0).exp() + 0.2) * 0.14 + 1500.0;
    for (name, expected) in [
        ("r0", 900.0),
        ("r0_hold", 0.1),
        ("e1", 0.5),
        ("e2", 0.3),
        ("r_start", start),
        ("r1_hold", 0.9 * start),
        ("r_settled", start * (0.9 + 0.1 * 0.2)),
    ] {
        let found = derived.iter().find(|own| own.parameter.name == name).unwrap().value;
        assert!((found - expected).abs() <= 1e-14 * expected, "{name}: {found}");
    }
}
