//! A filter gives the same results, bit for bit, on a recording with broken rows and without them. A smoother that
//! recomputes states gives the same results, bit for bit, as one that stores them all.

use std::collections::BTreeMap;

use ohmstrain::Sensor;
use ohmstrain_ekf::correction::FeatureScale;
use ohmstrain_ekf::{Guard, Reading, StepError};
use ohmstrain_model::{Branch, Gauge, StrainRange};
use ohmstrain_sensor::{
    CorrectionParams, CorrectorParams, EstimatorKind, EstimatorParams, FORMAT, Filter, InputScales, LawParams, Learned,
    MotionParams, NoiseParams, Options, PhaseParams, ProcessParams, Quantity, ReadingUnit, Rows, SensorParams,
    SimulatedParams, Smoother, Start, StaticCubic, TrainingRow, Validity, build_filter, build_filter_with,
    build_smoother_with,
};
use proptest::prelude::*;

/// A sensor with parameters for every estimator.
fn sensor() -> SensorParams {
    let limits = StrainRange { lower: 0.0, upper: 0.3 };
    let branch = |tau_s: f64| Branch {
        tau_s,
        extend_gain: 0.8,
        retract_gain: -0.5,
        extend_gain_slope: -0.6,
        retract_gain_slope: 0.4,
    };
    let estimator = EstimatorParams {
        score: 0.0,
        strain_sd_scale: 1.1,
        smoothed_sd_scale: None,
        motion: MotionParams { rate_time_s: 1.5, rate_sd_per_s: 0.05, strain_mean: 0.15, strain_sd: 0.1 },
        noise: NoiseParams {
            reading_sd: 2e-3,
            reading_time_s: 0.0,
            branch_sd: 5e-3,
            baseline_sd: 0.02,
            baseline_time_s: 30.0,
        },
        phases: Some(PhaseParams {
            hold_time_s: 2.0,
            move_time_s: 2.0,
            reversal: 0.3,
            speed_per_s: 0.05,
            tempering: 0.7,
        }),
        settling: None,
    };
    let law = |taus_s: &[f64]| LawParams {
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        range: limits,
        gauge: Gauge::Polynomial { coefficients: [1.6, -1.2, 0.5] },
        branches: taus_s.iter().map(|tau_s| branch(*tau_s)).collect(),
    };
    SensorParams {
        format: FORMAT,
        made_by: "test".into(),
        quantity: Quantity::Strain,
        reading: ReadingUnit::Ratio,
        rest_reading: 1.0,
        measured_rest: None,
        default_estimator: EstimatorKind::Ekf,
        summary: None,
        tested: None,
        limits,
        validity: Validity {
            lower: 0.0,
            upper: 0.3,
            reading_lower: 0.9,
            reading_upper: 1.6,
            fastest_rate_per_s: 0.2,
            duration_s: 100.0,
            drifts: false,
            longest_repeat_s: 0.0,
            longest_unturned_s: None,
            resolution: None,
        },
        sessions: None,
        unstated: Default::default(),
        temperature: None,
        static_cubic: StaticCubic {
            reading_centre: 1.0,
            reading_scale: 1.0,
            coefficients: [0.1, 0.1, 0.0, 0.0],
            error_sd: Some(0.01),
            range: limits,
        },
        joint: None,
        law: law(&[4.0, 32.0]),
        estimators: EstimatorKind::ALL.map(|kind| (kind, estimator)).into_iter().collect::<BTreeMap<_, _>>(),
        recordings: vec![],
        findings: None,
        uncertainty: None,
        correction: Some(correction()),
    }
}

/// Returns a correction trained on rows that are all different.
fn correction() -> CorrectionParams {
    let weights = |rows: usize| (0..rows).map(|k| 0.02 * (1.7 * k as f64).cos()).collect();
    let process = |inputs: Vec<usize>| ProcessParams {
        sd_scale: 1.1,
        mean: 0.02,
        sd: 0.1,
        least_sd: 0.05,
        noise_sd: 0.01,
        lengths: vec![4.0; inputs.len()],
        inputs,
        weights: weights(40),
        explained: vec![0.4, -0.1, 0.05, 0.3, 0.1, 0.2],
    };
    let column = |value: f64, inputs: usize| vec![value; inputs];
    let corrector = |future: usize, one_sided| CorrectorParams {
        sd_scale: 0.9,
        strain_sd: 0.09,
        order: (0..40).map(|k| (7 * k) % 40).collect(),
        inputs: InputScales {
            mean: column(0.1, 13 + future),
            sd: column(0.6, 13 + future),
            lower: column(-1.0, 13 + future),
            upper: column(1.0, 13 + future),
        },
        direct: process((6..13 + future).collect()),
        residual: process((0..13 + future).collect()),
        one_sided,
    };
    let wave = |k: usize, i: usize| ((0.3 + 0.11 * i as f64) * k as f64 + i as f64).sin();
    let row = |k: usize| TrainingRow {
        time_s: k as f64,
        strain: 0.15 + 0.12 * wave(k, 0),
        past: std::array::from_fn(|i| wave(k, i)),
        future: std::array::from_fn(|i| 0.5 * wave(k, 7 + i)),
        filtered: std::array::from_fn(|i| 0.2 + 0.1 * wave(k, 20 + i)),
        smoothed: std::array::from_fn(|i| 0.2 + 0.1 * wave(k, 30 + i)),
    };
    CorrectionParams {
        corrects: EstimatorKind::SignSplit,
        readings: FeatureScale { centre: 0.2, half_range: 0.25, rates: [0.02, 0.05], starts: [[0.1, 0.6]; 6] },
        filter: corrector(0, vec![]),
        smoother: corrector(6, vec![process((6..13).collect()), process((13..19).collect())]),
        rows: (0..40).map(row).collect(),
        simulated: SimulatedParams {
            mean: 0.15,
            sd: 0.03,
            length: 4.0,
            weights: weights(20),
            rows: (40..60).map(|k| row(k).past).collect(),
        },
    }
}

/// Returns a filter's full output as text; Rust prints numbers to the last bit.
fn shown(filter: &dyn Filter) -> String {
    format!("{:?}", filter.output())
}

/// Returns a smoother without a plausibility check.
fn smoother(params: &SensorParams, kind: EstimatorKind, guard: Guard<f64>) -> Box<dyn Smoother> {
    let options = Options { guard, ..Options::plain() };
    build_smoother_with(params, Learned::of(params).as_ref(), Some(kind), &options).unwrap()
}

/// Returns an invalid row: a time, a reading, and the reason for its rejection.
fn broken(kind: usize, now_s: f64) -> (f64, f64, StepError) {
    match kind {
        0 => (now_s - 0.1, 0.1, StepError::NegativeTimeStep),
        1 => (f64::NAN, 0.1, StepError::NonFiniteTimeStep),
        2 => (now_s + 0.1, f64::NAN, StepError::NonFiniteReading),
        _ => (now_s + 0.1, f64::INFINITY, StepError::NonFiniteReading),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn an_error_leaves_no_trace(
        rows in prop::collection::vec(
            (0.0..0.4_f64, prop::option::weighted(0.8, -0.1..0.6_f64), prop::option::weighted(0.3, 0..4_usize)), 1..40,
        ),
    ) {
        let params = sensor();
        for kind in EstimatorKind::ALL {
            let mut disturbed = build_filter(&params, Some(kind), Start::Unknown).unwrap();
            let mut calm = build_filter(&params, Some(kind), Start::Unknown).unwrap();
            let mut now_s = 0.0;
            for (dt_s, reading, trouble) in &rows {
                now_s += dt_s;
                let reading = reading.map(Reading::from);
                prop_assert_eq!(disturbed.step(now_s, reading), Ok(()));
                prop_assert_eq!(calm.step(now_s, reading), Ok(()));
                if let Some(trouble) = trouble {
                    let (time_s, reading, why) = broken(*trouble, now_s);
                    prop_assert_eq!(disturbed.step(time_s, Some(Reading::from(reading))), Err(why), "{}", kind.name());
                }
                prop_assert_eq!(shown(&*disturbed), shown(&*calm), "{}", kind.name());
            }
        }
    }
}

/// Rows without a reading have no effect: results at the other rows are the same, to the bit, if they are left out.
#[test]
fn rows_without_a_reading_leave_no_trace() {
    let params = sensor();
    let (time_s, all) = recording(600);
    let losses: [fn(usize) -> bool; 3] =
        [|k| k * 61 % 100 == 0, |k| k % 2 == 1, |k| k < 20 || (200..400).contains(&k) || k % 50 > 45];
    for (kind, is_lost) in EstimatorKind::ALL.into_iter().flat_map(|kind| losses.map(|is_lost| (kind, is_lost))) {
        let readings: Vec<_> = (0..600).map(|k| all[k].filter(|_| !is_lost(k))).collect();
        let read = || (0..600).filter(|k| readings[*k].is_some());
        for start in [Start::Unknown, Start::Strain(0.1)] {
            // A strain is known at the first row.
            let rows = || read().filter(|k| start == Start::Unknown || *k > 0);
            let first = (start != Start::Unknown).then_some(0);
            let mut filters = [0; 2].map(|_| build_filter(&params, Some(kind), start).unwrap());
            let [empty, cut] = &mut filters;
            let mut expected = Vec::new();
            for k in 0..600 {
                empty.step(time_s[k], readings[k]).unwrap();
                expected.push(shown(&**empty));
            }
            for k in first.into_iter().chain(rows()) {
                cut.step(time_s[k], readings[k]).unwrap();
                assert_eq!(shown(&**cut), expected[k], "{} row {k}", kind.name());
            }
        }
        let smoothed = |rows: &[usize]| {
            let times: Vec<f64> = rows.iter().map(|k| time_s[*k]).collect();
            let readings: Vec<_> = rows.iter().map(|k| readings[*k]).collect();
            smoother(&params, kind, Guard::none()).smooth(&times, &readings).unwrap()
        };
        let rows: Vec<usize> = read().collect();
        let (empty, cut) = (smoothed(&(0..600).collect::<Vec<_>>()), smoothed(&rows));
        for (k, expected) in rows.into_iter().zip(cut) {
            assert_eq!(empty[k], expected, "{} smoothed, row {k}", kind.name());
        }
    }
}

/// Returns a slow sine through a polynomial, with some missing readings, at times that jitter in their last digits.
fn recording(rows: usize) -> (Vec<f64>, Vec<Option<Reading<f64>>>) {
    let reading = |k: usize| {
        let strain = 0.15 + 0.12 * (k as f64 * 0.01).sin();
        (k % 7 != 3).then(|| Reading::from(1.6 * strain - 1.2 * strain * strain + 1e-3 * (k as f64 * 1.7).sin()))
    };
    (0..rows).map(|k| (k as f64 * 0.05, reading(k))).unzip()
}

/// Several segments, the last one short; the oracle holds every row until the last reading.
#[test]
fn a_long_recording_is_smoothed_as_if_all_states_were_kept() {
    let (time_s, readings) = recording(10_000);
    let mut params = sensor();
    // Waiting rows are reported with the wider of two intervals, so both are made equal.
    params.estimators.values_mut().for_each(|estimator| estimator.strain_sd_scale = 1.0);
    for kind in [EstimatorKind::Ekf, EstimatorKind::SignSplit] {
        for guard in [Guard::none(), Guard::none().with_gate(3.0, 5).unwrap()] {
            let options = Options { guard, ..Options::plain() };
            let mut kept = build_filter_with(&params, None, Some(kind), &options).unwrap();
            let mut expected = Vec::new();
            for (&time_s, &reading) in time_s.iter().zip(&readings) {
                kept.step_lagged(time_s, reading, 1e9, &mut |output| expected.push(output)).unwrap();
            }
            assert!(expected.is_empty());
            kept.flush_lagged(&mut |output| expected.push(output)).unwrap();

            let (mut smoother, mut first, mut segment) = (smoother(&params, kind, guard), time_s.len(), Vec::new());
            let row = |row: usize| (time_s[row], readings[row]);
            let mut back = smoother.way_back(Rows::new(time_s.len(), &row)).unwrap();
            while let Some(rows) = back.next_segment(&mut segment).unwrap() {
                assert_eq!(rows.end, first);
                assert!(segment.len() < 5000 && segment.as_slice() == &expected[rows.clone()], "{kind:?} {rows:?}");
                first = rows.start;
            }
            assert_eq!(first, 0, "{kind:?}");
        }
    }
}

#[test]
fn no_row_is_smoothed_to_nothing() {
    let kind = sensor().default_estimator;
    assert_eq!(smoother(&sensor(), kind, Guard::none()).smooth(&[], &[]), Ok(vec![]));
}

/// Filters of a sensor share its correction: a smoother's result depends neither on the number of calls nor on their order.
#[test]
fn a_correction_is_shared() {
    let params = SensorParams { default_estimator: EstimatorKind::Corrected, ..sensor() };
    let time_s: Vec<f64> = (0..50).map(|k| 0.1 * f64::from(k)).collect();
    let readings: Vec<f64> = time_s.iter().map(|time_s| 1.2 + 0.1 * time_s.sin()).collect();
    let fresh = || Sensor::from_params(params.clone()).unwrap();
    let smoothed = |sensor: &Sensor| format!("{:?}", sensor.smooth(&time_s, &readings).unwrap());
    let used = fresh();
    let expected = smoothed(&used);
    for sensor in [&fresh(), &used, &used.clone()] {
        assert_eq!(smoothed(sensor), expected);
    }
    assert_eq!(used, fresh());
}
