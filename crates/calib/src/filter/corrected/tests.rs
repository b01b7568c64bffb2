use std::ops::Range;

use ohmstrain_ekf::correction::{FEATURES, FeatureScale, OUTPUTS, ReadingFeatures, Starts, filter_inputs, mixture};
use ohmstrain_ekf::live::Sieve;
use ohmstrain_ekf::{Estimate, Gaussian, Guard, Reading, ReadingVerdict, StepError};

use super::{Corrected, Learned, future_features, outputs};
use crate::EstimatorKind;
use crate::filter::way_back::SEGMENT;
use crate::filter::{Filter, Output, Rows, WayBack};
use crate::params::RangeParams;
use crate::params::correction::ProcessParams;
use crate::params::correction::{
    CorrectionParams, CorrectionScale, CorrectorParams, FUTURE_FEATURES, SimulatedParams, SimulatedRow, TrainingRow,
    smoother_inputs,
};
use crate::params::recipe::Parts;

const LIMITS: RangeParams = RangeParams { lower: 0.0, upper: 0.4 };

/// Says of every row what its time says, less surely the longer no reading has come.
#[derive(Clone, Copy, Default)]
struct Fake {
    time_s: f64,
    gap: f64,
    missing: bool,
    guarded: bool,
    waiting: usize,
    nis: Option<f64>,
}

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
        startled: None,
    }
}

impl Fake {
    fn verdict(&self) -> ReadingVerdict {
        match (self.guarded, self.missing) {
            (true, _) => ReadingVerdict::Rejected,
            (_, true) => ReadingVerdict::Missing,
            _ => ReadingVerdict::Accepted,
        }
    }
}

impl Filter for Fake {
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.gap = if reading.is_some() { 0.0 } else { self.gap + time_s - self.time_s };
        self.missing = reading.is_none();
        self.time_s = time_s;
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        self.output().estimate.strain
    }

    fn output(&self) -> Output {
        let said = says(self.time_s, self.gap, self.verdict());
        Output { nis: self.nis.or(said.nis), ..said }
    }

    fn guard(&mut self, guard: Guard<f64>) {
        self.guarded = !guard.is_none();
    }

    fn sieve(&mut self, _: Sieve<f64>) {}

    /// Hands every row out two rows later, as if it had said 0.3 of all.
    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        _: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError> {
        if time_s < self.time_s {
            return Err(StepError::NegativeTimeStep);
        }
        self.step(time_s, reading)?;
        self.waiting += 1;
        if self.waiting > 2 {
            self.waiting -= 1;
            out(lagged());
        }
        Ok(())
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        (0..self.waiting).for_each(|_| out(lagged()));
        Ok(())
    }

    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)> {
        let mut said = Vec::new();
        for row in 0..rows.len() {
            let (time_s, reading) = rows.get(row);
            self.step(time_s, reading).map_err(|error| (row, error))?;
            said.push(self.output());
        }
        Ok(Box::new(FakeBack(said)))
    }
}

fn lagged() -> Output {
    let mut output = says(0.0, 0.0, ReadingVerdict::Accepted);
    output.estimate.strain = Gaussian { mean: 0.3, variance: 4e-4 };
    output
}

struct FakeBack(Vec<Output>);

impl WayBack for FakeBack {
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        let rows = (self.0.len().saturating_sub(1) / SEGMENT * SEGMENT)..self.0.len();
        *out = self.0.split_off(rows.start);
        Ok(if rows.is_empty() { None } else { Some(rows) })
    }
}

/// Low-passes start a third of the way to the middle.
const STARTS: Starts<f64> = [[0.0, 0.67]; 6];
const SCALE: CorrectionScale = CorrectionScale { centre: 0.25, half_range: 0.3, rates: [0.02, 0.05], starts: STARTS };

fn reading(time_s: f64) -> Reading<f64> {
    Reading::from(0.25 + 0.28 * (0.3 * time_s + 0.2).sin() + 0.02 * (2.1 * time_s).sin())
}

/// What has been seen up to a row.
type Seen = Option<[f64; FEATURES]>;

/// Features of the past, or of the future of times in falling order.
fn features(time_s: &[f64], readings: &[Option<Reading<f64>>], scale: FeatureScale<f64>) -> Vec<Seen> {
    let mut features = ReadingFeatures::new(scale);
    let mut before_s = time_s[0];
    let mut step = |time_s: f64, reading: Option<Reading<f64>>| {
        let dt_s = (time_s - before_s).abs();
        before_s = time_s;
        features.step(dt_s, reading.map(|reading| reading.value))
    };
    time_s.iter().zip(readings).map(|(time_s, reading)| step(*time_s, *reading)).collect()
}

fn both_ways(time_s: &[f64], readings: &[Option<Reading<f64>>]) -> (Vec<Seen>, Vec<Seen>) {
    let back: (Vec<f64>, Vec<Option<Reading<f64>>>) =
        (time_s.iter().rev().copied().collect(), readings.iter().rev().copied().collect());
    let mut future = features(&back.0, &back.1, SCALE.future());
    future.reverse();
    (features(time_s, readings, SCALE.past()), future)
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
    let simulated = |k: usize| SimulatedRow { past: row(k).past, strain: row(k).strain };
    let process = |length: f64, inputs: usize| ProcessParams {
        lengths: vec![length; inputs],
        noise: 0.1,
        noise_time_s: 2.0,
        sd_scale: 1.2,
    };
    let corrector = |future: usize, one_sided| CorrectorParams {
        sd_scale: 0.9,
        direct: process(2.0, FEATURES + future),
        residual: process(4.0, OUTPUTS + FEATURES + future),
        one_sided,
    };
    CorrectionParams {
        corrects: EstimatorKind::SignSplit,
        readings: SCALE,
        filter: corrector(0, Vec::new()),
        smoother: corrector(FUTURE_FEATURES, vec![process(2.0, FEATURES), process(4.0, 1 + FUTURE_FEATURES)]),
        rows: (0..600).step_by(10).map(row).collect(),
        simulated: SimulatedParams { sd: 0.2, rows: (3..600).step_by(40).map(simulated).collect() },
    }
}

fn corrected() -> Corrected {
    Corrected::new(Box::new(Fake::default()), &Learned::new(params(), LIMITS)).unwrap()
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
    let smoothed = corrected().smooth(&time_s, &readings).unwrap().unwrap();
    let correction = Learned::new(params(), LIMITS).for_smoother().unwrap();
    assert_eq!(smoothed.len(), time_s.len());
    let mut plain = Fake::default();
    for k in 0..time_s.len() {
        plain.step(time_s[k], readings[k]).unwrap();
        let said = plain.output();
        let mut expected = said.estimate.strain;
        if let Some(past) = past[k] {
            let future = future[k].map_or([0.0; FEATURES - 1], future_features);
            let inputs = smoother_inputs(&outputs(&said), &past, &future);
            expected = correction.correction().correct(&inputs, expected, 1.0).strain;
            // At readings the filter's variance is 1e-4, whatever the side.
            expected.variance += said.estimate.strain.variance - 1e-4;
        }
        let strain = smoothed[k].estimate.strain;
        // The low-passes of thousands of rows begin anew from what was kept: to the last bit, but for the growth.
        assert!(strain.mean == expected.mean && (strain.variance - expected.variance).abs() < 1e-15, "{k}");
        assert_eq!((smoothed[k].nis, smoothed[k].phases), (said.nis, said.phases));
    }
}

#[test]
fn a_missing_reading_is_held_and_the_variance_grows_with_the_filters() {
    let mut filter = corrected();
    // Before the first reading: what the filter says.
    filter.step(0.0, None).unwrap();
    assert_eq!(filter.strain(), says(0.0, 0.0, ReadingVerdict::Missing).estimate.strain);
    (1..200).for_each(|k| filter.step(0.1 * f64::from(k), Some(reading(0.1 * f64::from(k)))).unwrap());
    let now = filter.readings.features.now();
    let known = filter.strain();
    filter.step(0.1 * 199.0, None).unwrap();
    assert_eq!(filter.readings.features.now(), now);
    assert_eq!(filter.strain(), known);
    for k in 1..5 {
        let time_s = 19.9 + f64::from(k);
        filter.step(time_s, None).unwrap();
        let inputs = filter_inputs(&outputs(&says(time_s, 0.0, ReadingVerdict::Accepted)), &now.unwrap());
        let filtered = says(time_s, f64::from(k), ReadingVerdict::Missing).estimate.strain;
        let expected = filter.of_filter.correction().correct(&inputs, filtered, 1.0).strain;
        let strain = filter.strain();
        assert_eq!(strain.mean, expected.mean);
        // The filter's variance has grown by 1e-4 a second.
        assert!((strain.variance - expected.variance - 1e-4 * f64::from(k)).abs() < 1e-15);
        assert!(strain.variance > known.variance, "{k}");
    }
}

/// The mean of normalised innovations squared of rows before, fading with 20 s, in the naive sum.
#[test]
fn what_has_learned_from_a_surprised_filter_is_less_sure() {
    let fake = Fake { nis: Some(9.0), ..Fake::default() };
    let mut filter = Corrected::new(Box::new(fake), &Learned::new(params(), LIMITS)).unwrap();
    for k in 0..400 {
        let time_s = 0.1 * f64::from(k);
        filter.step(time_s, Some(reading(time_s))).unwrap();
        // The first row has no interval before it, and a row does not know of its own innovation.
        let weight = |row: i32| (1.0 - (-0.1_f64 / 20.0).exp()) * (-0.1 * f64::from(k - 1 - row) / 20.0).exp();
        let mean: f64 = (1..k).map(|row| 9.0 * weight(row)).sum();
        let (inputs, said) = (filter.readings.features.now().unwrap(), filter.filter.output());
        let inputs = filter_inputs(&outputs(&said), &inputs);
        let learned = filter.of_filter.correction().correct(&inputs, said.estimate.strain, mean.max(1.0)).strain;
        let strain = filter.strain();
        assert!((strain.mean - learned.mean).abs() < 1e-12 && (strain.variance / learned.variance - 1.0).abs() < 1e-9);
    }
}

#[test]
fn what_a_guard_rejects_is_not_seen() {
    let mut filter = corrected();
    (0..100).for_each(|k| filter.step(0.1 * f64::from(k), Some(reading(0.1 * f64::from(k)))).unwrap());
    let now = filter.readings.features.now();
    filter.guard(Guard::none().with_gate(9.0, 5).unwrap());
    filter.step(10.0, Some(Reading::from(100.0))).unwrap();
    assert_eq!(filter.readings.features.now(), now);
    filter.guard(Guard::none());
    filter.step(10.1, Some(reading(10.1))).unwrap();
    assert_ne!(filter.readings.features.now(), now);
}

/// With a fixed lag every row comes out once and in order, mixed with what was said of it when it came, whatever rows were
/// refused in between.
#[test]
fn a_lagged_row_is_mixed_with_what_was_said_of_it() {
    let mut live = corrected();
    let mut lagging = corrected();
    let (mut said, mut out) = (Vec::new(), Vec::new());
    for k in 0..50 {
        let time_s = 0.1 * f64::from(k);
        live.step(time_s, Some(reading(time_s))).unwrap();
        said.push(live.strain());
        lagging.step_lagged(time_s, Some(reading(time_s)), 0.2, &mut |output| out.push(output)).unwrap();
        if k == 20 {
            assert!(lagging.step_lagged(-1.0, None, 0.2, &mut |output| out.push(output)).is_err());
        }
    }
    assert_eq!(out.len(), 48);
    lagging.flush_lagged(&mut |output| out.push(output)).unwrap();
    let expected: Vec<Gaussian<f64>> = said.iter().map(|said| mixture([*said, lagged().estimate.strain])).collect();
    assert_eq!(out.iter().map(|output| output.estimate.strain).collect::<Vec<_>>(), expected);
}

/// What is left is what the others say by themselves; the factor on the interval is found anew.
#[test]
fn parts_that_are_switched_off_say_nothing() {
    let with = |parts| Learned::with_parts(params(), LIMITS, parts);
    let row = params().rows[7];
    let filtered = Gaussian { mean: row.filtered[0], variance: 1e-4 };
    let filter = |parts| with(parts).for_filter().unwrap().correction().correct(&row.filter_inputs(), filtered, 1.0);
    let smoother =
        |parts| with(parts).for_smoother().unwrap().correction().correct(&row.smoother_inputs(), filtered, 1.0);
    let all = filter(Parts::ALL);
    let alone = Parts { simulated: false, ..Parts::ALL };
    for (off, left) in
        [(Parts { direct: false, ..alone }, all.residual), (Parts { residual: false, ..alone }, all.direct)]
    {
        let said = filter(off);
        assert!((said.strain.mean - left.mean).abs() < 1e-9, "{said:?} {left:?}");
        assert!(said.simulated.is_none() && said.strain.variance < 1.0);
    }
    assert!(all.simulated.is_some() && filter(alone).strain.mean != all.strain.mean);
    let all = smoother(Parts::ALL);
    let [past, future] = all.one_sided;
    let voices = [all.direct, all.residual, past, future];
    let mixed = smoother(Parts { consensus: false, ..Parts::ALL }).strain.mean;
    assert!((mixed - mixture(voices).mean).abs() < 1e-12, "{mixed} {all:?}");
    let two = smoother(Parts { one_sided: false, consensus: false, ..Parts::ALL }).strain.mean;
    assert!((two - mixture(voices[..2].iter().copied()).mean).abs() < 1e-9, "{two} {all:?}");
}
