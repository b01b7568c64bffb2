use std::ops::Range;
use std::sync::Arc;

use ohmstrain_ekf::correction::{
    FEATURES, FILTER_INPUTS, FeatureScale, ReadingFeatures, Starts, filter_inputs, mixture,
};
use ohmstrain_ekf::live::{Flags, Protections};
use ohmstrain_ekf::{Estimate, Gaussian, Guard, Reading, ReadingVerdict, StepError};
use ohmstrain_model::{Gauge, StrainRange};

use super::{CorrectedWayBack, Learned, future_features, outputs};
use crate::EstimatorKind;
use crate::correction::{ONE_SIDED, ProcessKind, SMOOTHER_INPUTS};
use crate::params::correction::ProcessParams;
use crate::params::correction::{
    CorrectionParams, CorrectorParams, FUTURE_FEATURES, InputScales, SimulatedParams, TrainingRow, smoother_inputs,
};
use crate::params::estimator::{EstimatorParams, MotionParams, NoiseParams, PhaseParams};
use crate::params::law::LawParams;
use crate::run::build::FilterParts;
use crate::run::last_rows::LastRows;
use crate::run::options::Options;
use crate::run::turns::Turns;
use crate::run::{Filter, Output, Rows, SEGMENT, WayBack};

const LIMITS: StrainRange<f64> = StrainRange { lower: 0.0, upper: 0.4 };

/// Returns an output whose strain is a function of time, with a variance that grows with the time since the last reading.
fn says(time_s: f64, gap: f64, verdict: ReadingVerdict) -> Output {
    let known = |mean: f64| Gaussian { mean, variance: 1e-4 };
    let strain = Gaussian { mean: 0.2 + 0.15 * (0.3 * time_s).sin(), variance: 1e-4 * (1.0 + gap) };
    Output {
        estimate: Estimate {
            strain,
            rate: known(0.045 * (0.3 * time_s).cos()),
            relaxation: known(0.01 * (0.11 * time_s).sin()),
            baseline: 0.02 * (0.07 * time_s).cos(),
            held: known(0.3),
            still_relaxes: known(0.01),
            beyond_border: 0.0,
            near_ramp_border: false,
        },
        nis: Some(1.0),
        verdict,
        phases: Some([0.7, 0.1, 0.2]),
        reading: None,
        doubts: Flags::NONE,
        doubted: 0.0,
        rest_off: 0.0,
    }
}

struct FakeBack(Vec<Output>, Turns);

impl WayBack for FakeBack {
    fn turns(&self) -> &Turns {
        &self.1
    }

    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        let rows = (self.0.len().saturating_sub(1) / SEGMENT * SEGMENT)..self.0.len();
        *out = self.0.split_off(rows.start);
        Ok(if rows.is_empty() { None } else { Some(rows) })
    }
}

/// Low-passes start a third of the way from the reading to the centre.
const STARTS: Starts<f64> = [[0.0, 0.67]; 6];
const SCALE: FeatureScale<f64> = FeatureScale { centre: 0.25, half_range: 0.3, rates: [0.02, 0.05], starts: STARTS };

fn reading(time_s: f64) -> Reading<f64> {
    Reading::from(0.25 + 0.28 * (0.3 * time_s + 0.2).sin() + 0.02 * (2.1 * time_s).sin())
}

/// Features of the readings up to a row.
type CorrectionReading = Option<[f64; FEATURES]>;

/// Features of the past, or of the future of times in falling order.
fn features(time_s: &[f64], readings: &[Option<Reading<f64>>], scale: FeatureScale<f64>) -> Vec<CorrectionReading> {
    let mut features = ReadingFeatures::new(scale);
    let mut before_s = time_s[0];
    let mut step = |time_s: f64, reading: Option<Reading<f64>>| {
        let dt_s = (time_s - before_s).abs();
        before_s = time_s;
        features.step(dt_s, reading.map(|reading| reading.value))
    };
    time_s.iter().zip(readings).map(|(time_s, reading)| step(*time_s, *reading)).collect()
}

fn both_ways(time_s: &[f64], readings: &[Option<Reading<f64>>]) -> (Vec<CorrectionReading>, Vec<CorrectionReading>) {
    let back: (Vec<f64>, Vec<Option<Reading<f64>>>) =
        (time_s.iter().rev().copied().collect(), readings.iter().rev().copied().collect());
    let mut future = features(&back.0, &back.1, SCALE.future());
    future.reverse();
    (features(time_s, readings, SCALE), future)
}

fn params() -> CorrectionParams {
    let time_s: Vec<f64> = (0..600).map(|k| 0.1 * f64::from(k)).collect();
    let readings: Vec<_> = time_s.iter().map(|time_s| Some(reading(*time_s))).collect();
    let (past, future) = both_ways(&time_s, &readings);
    let row = |k: usize| TrainingRow {
        time_s: time_s[k],
        strain: 0.2 + 0.14 * (0.3 * time_s[k] + 0.05).sin(),
        past: past[k].unwrap(),
        future: future_features(future[k].unwrap()),
        filtered: outputs(&says(time_s[k], 0.0, ReadingVerdict::Accepted)),
        smoothed: outputs(&says(time_s[k], 0.0, ReadingVerdict::Accepted)),
    };
    // Artificial weights: the estimate of a row is a smooth function of all its inputs.
    let weights = |rows: usize| (0..rows).map(|k| 0.01 * (1.3 * k as f64).sin()).collect();
    let process = |length: f64, inputs: Vec<usize>| ProcessParams {
        sd_scale: 1.2,
        mean: 0.03,
        sd: 0.2,
        least_sd: 0.1,
        noise_sd: 0.02,
        lengths: vec![length; inputs.len()],
        inputs,
        weights: weights(60),
        explained: (0..6).map(|k| 0.3 * (0.7 * f64::from(k)).cos()).collect(),
    };
    let column = |value: f64, inputs: usize| vec![value; inputs];
    let corrector = |future: usize, one_sided| CorrectorParams {
        sd_scale: 0.9,
        strain_sd: 0.1,
        order: (0..60).rev().collect(),
        inputs: InputScales {
            mean: column(0.1, FILTER_INPUTS + future),
            sd: column(0.5, FILTER_INPUTS + future),
            lower: column(-0.9, FILTER_INPUTS + future),
            upper: column(0.9, FILTER_INPUTS + future),
        },
        direct: process(2.0, ProcessKind::Direct.places(FILTER_INPUTS + future)),
        residual: process(4.0, ProcessKind::Residual.places(FILTER_INPUTS + future)),
        one_sided,
    };
    CorrectionParams {
        corrects: EstimatorKind::SignSplit,
        readings: SCALE,
        filter: corrector(0, Vec::new()),
        smoother: corrector(FUTURE_FEATURES, ONE_SIDED.map(|side| process(3.0, side.places(SMOOTHER_INPUTS))).to_vec()),
        rows: (0..600).step_by(10).map(row).collect(),
        simulated: SimulatedParams {
            mean: 0.2,
            sd: 0.2,
            length: 4.0,
            weights: weights(15),
            rows: (3..600).step_by(40).map(|k| row(k).past).collect(),
        },
    }
}

/// Two whole segments and a short one. Readings are missing now and then, among others around a border of segments, at
/// the start and at the end.
fn recording() -> (Vec<f64>, Vec<Option<Reading<f64>>>) {
    let rows = 2 * SEGMENT + 500;
    let missing = |k: usize| k % 11 == 3 || k < 2 || k + 4 > rows || k.abs_diff(SEGMENT) < 6;
    let time_s: Vec<f64> = (0..rows).map(|k| 0.05 * k as f64).collect();
    let readings = time_s.iter().enumerate().map(|(k, time_s)| (!missing(k)).then(|| reading(*time_s))).collect();
    (time_s, readings)
}

#[test]
fn segments_say_what_the_whole_recording_says() {
    let (time_s, readings) = recording();
    let (past, future) = both_ways(&time_s, &readings);
    let mut gap = 0.0;
    let plain: Vec<Output> = (0..time_s.len())
        .map(|k| {
            gap = if k > 0 && readings[k].is_none() { gap + time_s[k] - time_s[k - 1] } else { 0.0 };
            let verdict = if readings[k].is_none() { ReadingVerdict::Missing } else { ReadingVerdict::Accepted };
            says(time_s[k], gap, verdict)
        })
        .collect();
    let row = |k: usize| (time_s[k], readings[k]);
    let learned = Learned::new(&params(), LIMITS);
    let back = Box::new(FakeBack(plain.clone(), Turns::default()));
    let filtered = |time_s: f64| Gaussian { mean: 0.3 - 0.001 * time_s.cos(), variance: 3e-4 };
    let rows = Rows::new(time_s.len(), &row);
    let mut last_rows = LastRows::of(rows);
    time_s.iter().enumerate().for_each(|(k, time_s)| last_rows.watch(k, filtered(*time_s)));
    let mut back = CorrectedWayBack::new(back, &learned, rows, last_rows);
    let (mut smoothed, mut segment) = (Vec::new(), Vec::new());
    while back.next_segment(&mut segment).unwrap().is_some() {
        smoothed.splice(0..0, segment.iter().copied());
    }
    let correction = Arc::clone(&learned.smoother);
    assert_eq!(smoothed.len(), time_s.len());
    for k in 0..time_s.len() {
        let bare_row = plain[k];
        let mut expected = bare_row.estimate.strain;
        if let Some(past) = past[k] {
            let future = future[k].map_or([0.0; FEATURES - 1], future_features);
            let inputs = smoother_inputs(&outputs(&bare_row), &past, &future);
            expected = correction.correction().correct(&inputs, expected, 1.0).strain;
            // At readings the filter's variance is 1e-4, whatever the side.
            expected.variance += bare_row.estimate.strain.variance - 1e-4;
        }
        // The last three rows have no reading. Time constant and least weight are those of `last_rows.rs`.
        let weight = (-(time_s[time_s.len() - 4] - time_s[k]).max(0.0) / 4.0).exp();
        let is_last = weight >= 0.01;
        if is_last {
            let Gaussian { mean, variance } = filtered(time_s[k]);
            let square = |of: Gaussian<f64>| of.variance + of.mean * of.mean;
            let second = weight * (variance + mean * mean) + (1.0 - weight) * square(expected);
            let mean = weight * mean + (1.0 - weight) * expected.mean;
            expected = Gaussian { mean, variance: second - mean * mean };
        }
        let strain = smoothed[k].estimate.strain;
        // The low-passes restart after thousands of rows from the stored state: equal to the last bit, except for the growth,
        // and for the mean of a mixture, which is rounded otherwise.
        let rounding = if is_last { 2.0 * f64::EPSILON } else { 0.0 };
        assert!((strain.mean - expected.mean).abs() <= rounding, "{k}");
        assert!((strain.variance - expected.variance).abs() < 1e-15, "{k}");
        assert_eq!((smoothed[k].nis, smoothed[k].phases), (bare_row.nis, bare_row.phases));
    }
}

/// A law without branches, and an extended Kalman filter for it.
fn law_and_estimator() -> (LawParams, EstimatorParams) {
    let law = LawParams {
        gauge: Gauge::Polynomial { coefficients: [1.4, -0.3, 0.0] },
        extend_viscosity_s: 0.01,
        retract_viscosity_s: -0.01,
        branches: Vec::new(),
        range: LIMITS,
    };
    let estimator = EstimatorParams {
        score: 0.0,
        strain_sd_scale: 1.3,
        smoothed_sd_scale: Some(1.1),
        motion: MotionParams { rate_sd_per_s: 0.05, rate_time_s: 2.0, strain_mean: 0.2, strain_sd: 0.1 },
        noise: NoiseParams {
            baseline_sd: 0.02,
            baseline_time_s: 100.0,
            reading_sd: 4e-3,
            reading_time_s: 0.0,
            branch_sd: 0.01,
        },
        phases: None,
        settling: None,
    };
    (law, estimator)
}

/// Builds that filter, corrected or not, with or without a gate.
fn live(learned: Option<&Arc<Learned>>, gate: Option<f64>) -> Box<dyn Filter> {
    let (law, estimator) = law_and_estimator();
    let guard = gate.map_or_else(Guard::none, |gate| Guard::none().with_gate(gate, 5).unwrap());
    let options = Options { guard, protections: Protections::NONE, ..Options::plain() };
    FilterParts::of_law(EstimatorKind::Ekf, &law, estimator, LIMITS).with(options).filter(learned).unwrap()
}

/// Rows at 8 Hz, whose times are exact in binary. They begin without a reading; later readings are missing singly and
/// for seconds; two are outliers.
fn broken_recording() -> Vec<(f64, Option<Reading<f64>>)> {
    let row = |k: u32| {
        let time_s = 0.125 * f64::from(k);
        let is_lost = k < 2 || k % 11 == 3 || (200..260).contains(&k);
        let value = if k == 100 || k == 400 { Reading::from(5.0) } else { reading(time_s) };
        (time_s, (!is_lost).then_some(value))
    };
    (0..600).map(row).collect()
}

/// Compares a corrected filter with the bare filter and a naive correction. Where a reading is missing or rejected, the
/// features stay and the variance grows with the filter's. Innovations of earlier rows, fading with 20 s, widen it; here they
/// are summed naively.
#[test]
fn a_corrected_filter_says_what_the_bare_one_beside_it_and_its_readings_say() {
    let learned = Learned::new(&params(), LIMITS);
    let correction = Arc::clone(&learned.filter);
    let (mut bare, mut corrected) = (live(None, Some(30.0)), live(Some(&learned), Some(30.0)));
    let mut features = ReadingFeatures::new(SCALE);
    let (mut last_s, mut known, mut innovations) = (0.0, None, Vec::<(f64, f64)>::new());
    let mut rejected = 0;
    for (time_s, reading) in broken_recording() {
        bare.step(time_s, reading).unwrap();
        corrected.step(time_s, reading).unwrap();
        let bare_row = bare.output();
        let seen = reading.filter(|_| bare_row.verdict.is_taken());
        rejected += usize::from(bare_row.verdict == ReadingVerdict::Rejected);
        let past = features.step(time_s - last_s, seen.map(|reading| reading.value)).or(features.now());
        last_s = time_s;
        let filtered = bare_row.estimate.strain;
        if seen.is_some() {
            known = Some(filtered.variance);
        }
        // The first innovation has no interval before it, and a row's own innovation does not count.
        let share = |k: usize| 1.0 - (-(innovations[k].0 - innovations[k - 1].0) / 20.0).exp();
        let last = innovations.last().map_or(0.0, |last| last.0);
        let fading = |k: usize| (-(last - innovations[k].0) / 20.0).exp();
        let mean: f64 = (1..innovations.len()).map(|k| innovations[k].1.min(30.0) * share(k) * fading(k)).sum();
        let expected = past.map_or(filtered, |past| {
            let inputs = filter_inputs(&outputs(&bare_row), &past);
            let strain = correction.correction().correct(&inputs, filtered, mean.max(1.0)).strain;
            let grown = if seen.is_none() { filtered.variance - known.unwrap() } else { 0.0 };
            Gaussian { variance: strain.variance + grown.max(0.0), ..strain }
        });
        let strain = corrected.strain();
        let off = (strain.mean - expected.mean).abs().max((strain.variance / expected.variance - 1.0).abs());
        assert!(off < 1e-9, "{time_s} s: {strain:?} {expected:?}");
        let bare_but_strain = Estimate { strain, ..bare_row.estimate };
        assert_eq!(corrected.output(), Output { estimate: bare_but_strain, ..bare_row });
        if let (Some(nis), true) = (bare_row.nis, seen.is_some()) {
            innovations.push((time_s, nis));
        }
    }
    assert_eq!(rejected, 2);
}

/// Tests that with a fixed lag every row comes out once and in order, mixed with its first estimate, whatever rows were
/// rejected in between.
#[test]
fn a_lagged_row_is_mixed_with_its_first_estimate() {
    let learned = Learned::new(&params(), LIMITS);
    let [mut now, mut lagging] = [0; 2].map(|_| live(Some(&learned), None));
    let mut bare = live(None, None);
    let (mut bare_row, mut out, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..50 {
        let time_s = 0.1 * f64::from(k);
        let reading = Some(reading(time_s));
        now.step(time_s, reading).unwrap();
        bare_row.push(now.strain());
        lagging.step_lagged(time_s, reading, 0.2, &mut |output| out.push(output)).unwrap();
        bare.step_lagged(time_s, reading, 0.2, &mut |output| plain.push(output)).unwrap();
        if k == 20 {
            assert!(lagging.step_lagged(-1.0, None, 0.2, &mut |output| out.push(output)).is_err());
        }
    }
    assert_eq!(out.len(), 48);
    lagging.flush_lagged(&mut |output| out.push(output)).unwrap();
    bare.flush_lagged(&mut |output| plain.push(output)).unwrap();
    // The readings are the law's own: innovations are no larger than stated.
    let expected: Vec<Gaussian<f64>> =
        bare_row.iter().zip(&plain).map(|(bare_row, plain)| mixture([*bare_row, plain.estimate.strain])).collect();
    assert_eq!(out.iter().map(|output| output.estimate.strain).collect::<Vec<_>>(), expected);
}

/// Phase histories take steps of at most a fiftieth of the shortest phase, fifteen between rows of 0.3 s. With steps four times as
/// long, digits change but the strain stays well within its interval; with a factor of 1 the result is bit-identical.
#[test]
fn longer_steps_between_readings_change_little() {
    let (law, estimator) = law_and_estimator();
    let phases = PhaseParams { hold_time_s: 1.0, move_time_s: 10.0, reversal: 0.5, speed_per_s: 0.05, tempering: 1.0 };
    let estimator = EstimatorParams { phases: Some(phases), ..estimator };
    let own_steps = FilterParts::of_law(EstimatorKind::Hypotheses, &law, estimator, LIMITS);
    let strains = |parts: FilterParts| -> Vec<Gaussian<f64>> {
        let mut filter = parts.filter(None).unwrap();
        let row = |k: u32| {
            let time_s = 0.3 * f64::from(k);
            filter.step(time_s, Some(reading(time_s))).unwrap();
            filter.strain()
        };
        (0..400).map(row).collect()
    };
    let expected = strains(own_steps);
    assert_eq!(strains(own_steps.in_longer_steps(1.0)), expected);
    let longer = strains(own_steps.in_longer_steps(4.0));
    let apart = longer.iter().zip(&expected).map(|(longer, own)| (longer.mean - own.mean).abs() / own.sd());
    let farthest = apart.fold(0.0, f64::max);
    assert!(farthest > 1e-6 && farthest < 0.5, "{farthest} deviations");
}
