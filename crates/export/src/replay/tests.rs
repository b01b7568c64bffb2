use ohmstrain::{Filter, FilterBuilder, Influence, Sensor};
use ohmstrain_ekf::live::SensorEstimator;
use ohmstrain_ekf::{Gaussian, StepError};
use ohmstrain_sensor::{EstimatorKind, SensorParams, Sessions, Unstated};

use super::super::fixed_rate::longest_step_s;
use super::{ChipFilter, FixedRate, Plan, Protections, StepNumbers, Task, TwinFilter, with_twin};

const SENSOR: &str = include_str!("../../tests/fixtures/representative.toml");

/// Returns a sensor whose correction belongs to phase histories.
fn sensor() -> Sensor {
    Sensor::from_toml(SENSOR).unwrap()
}

/// Returns the same sensor with sign-split hypotheses instead, and with different sessions.
fn sign_split_sensor() -> Sensor {
    let mut params = sensor().params().clone();
    let mut estimator = params.estimators[&EstimatorKind::Hypotheses];
    estimator.phases.iter_mut().for_each(|phases| phases.speed_per_s = 0.0);
    params.estimators = [(EstimatorKind::SignSplit, estimator)].into();
    params.correction.iter_mut().for_each(|correction| correction.corrects = EstimatorKind::SignSplit);
    params.sessions = Some(Sessions { rest_sd: 0.15, start_sd: 0.07 });
    // The recording below turns every few seconds, except while readings are missing.
    params.validity.longest_unturned_s = Some(2.5);
    params.unstated = Unstated { filter_sd: 0.01, smoother_sd: 0.02 };
    Sensor::from_params(params).unwrap()
}

/// A row of a recording.
#[derive(Clone, Copy)]
struct RecordedRow {
    time_s: f64,
    reading: Option<f64>,
}

/// Returns a recording of the law's own readings, at times that jitter by milliseconds.
fn rows(params: &SensorParams) -> Vec<RecordedRow> {
    let law = params.law.to_model::<2>().unwrap();
    let mut time_s = 0.0;
    let row = |k: u32| {
        time_s += (1e3 * (0.05 + 0.03 * (1.7 * f64::from(k)).sin())).round() * 1e-3;
        let strain = 0.5 * params.limits.span() * (1.0 - (0.9 * time_s).cos());
        let rho = law.gauge_value_and_slope(strain).0 + 1e-3 * (5.3 * f64::from(k)).sin();
        RecordedRow { time_s, reading: Some(params.rest_reading * (1.0 + rho)) }
    };
    (0..3000).map(row).collect()
}

/// Returns the estimates of the twin in double precision, row by row.
fn twin(sensor: &Sensor, kind: EstimatorKind, rows: &[RecordedRow], protections: Protections) -> Vec<Gaussian<f64>> {
    let params = sensor.params();
    let parts = ChipFilter::new(params, &Plan { kind: Some(kind), ..Plan::default() }).unwrap();
    of_computer(params, &parts, Replayed { rows, protections })
}

/// Runs a task with the twin in double precision, with the steps of a computer: lengths rounded to a nanosecond, and pauses
/// divided without the limits of a table.
fn of_computer<J: Task<f64>>(params: &SensorParams, parts: &ChipFilter, task: J) -> J::Output {
    let mut fixed = FixedRate::<2, 5>::new::<15>(params, parts, 0.05).unwrap();
    let longest_s = longest_step_s::<2, 5, 15>(&fixed.reference, &fixed.parts).unwrap();
    fixed.parts.live.longest_step_s = (longest_s * 1_073_741_824.0).floor() / 1_073_741_824.0;
    with_twin::<_, 2, 5, 15, _>(&fixed, fixed.reference, fixed.exact(), task).unwrap()
}

/// Task that replays rows unchanged.
struct Replayed<'a> {
    rows: &'a [RecordedRow],
    protections: Protections,
}

impl Task<f64> for Replayed<'_> {
    type Output = Vec<Gaussian<f64>>;

    fn run<F, const N: usize, const L: usize>(
        self,
        live: TwinFilter<'_, f64, F, N, L>,
    ) -> Result<Vec<Gaussian<f64>>, StepError>
    where
        F: SensorEstimator<f64, N, L, Prepared = F> + StepNumbers<f64>,
    {
        let (mut live, mut last_s) = (live.protected_by(self.protections), None);
        let strain = |row: &RecordedRow| {
            let dt_s = row.time_s - last_s.replace(row.time_s).unwrap_or(row.time_s);
            let reading = row.reading.map(|reading| live.relative(reading, 0.0));
            live.step_after(dt_s, reading).map(|row| row.strain)
        };
        self.rows.iter().map(strain).collect()
    }
}

/// Returns the estimates of the library's filter, row by row.
fn library(filter: &mut Filter, rows: &[RecordedRow]) -> Vec<(f64, f64)> {
    let row = |row: &RecordedRow| {
        let estimate = filter.step(row.time_s, row.reading).unwrap();
        (estimate.strain, estimate.strain_sd)
    };
    rows.iter().map(row).collect()
}

/// Compares a twin that rested on another day, with another R₀, with the filter that is given that R₀ and starts at zero.
#[test]
fn a_twin_restarted_at_zero_equals_the_librarys_filter_started_there() {
    let (sensor, another_day) = (sensor(), 1.08);
    let params = sensor.params();
    let rested = another_day * params.measured_rest.unwrap();
    let mut rows = rows(params);
    let parts = ChipFilter::new(params, &Plan::default()).unwrap();
    let estimates = of_computer(params, &parts, ElsewhereAfter { rows: &rows, another_day, rested });
    let mut filter = sensor.filter().rest_resistance(rested).initial_strain(0.0).build().unwrap();
    rows.iter_mut().for_each(|row| row.reading = row.reading.map(|reading| another_day * reading));
    for (k, (estimate, expected)) in estimates.into_iter().zip(library(&mut filter, &rows)).enumerate() {
        let off = ((estimate.mean - expected.0) / expected.1).abs().max((estimate.sd() / expected.1 - 1.0).abs());
        assert!(off < 1e-9, "row {k} is {off} off");
    }
}

/// A twin that has run for a while, and rests on another day.
struct ElsewhereAfter<'a> {
    rows: &'a [RecordedRow],
    another_day: f64,
    rested: f64,
}

impl Task<f64> for ElsewhereAfter<'_> {
    type Output = Vec<Gaussian<f64>>;

    fn run<F, const N: usize, const L: usize>(
        self,
        mut live: TwinFilter<'_, f64, F, N, L>,
    ) -> Result<Vec<Gaussian<f64>>, StepError>
    where
        F: SensorEstimator<f64, N, L, Prepared = F> + StepNumbers<f64>,
    {
        for row in &self.rows[..600] {
            live.step_after(0.05, row.reading.map(|reading| live.relative(reading, 0.0)))?;
        }
        live.rezero(self.rested)?;
        let mut last_s = None;
        let strain = |row: &RecordedRow| {
            let dt_s = row.time_s - last_s.replace(row.time_s).unwrap_or(row.time_s);
            let reading = row.reading.map(|reading| live.relative(self.another_day * reading, 0.0));
            live.step_after(dt_s, reading).map(|row| row.strain)
        };
        self.rows.iter().map(strain).collect()
    }
}

/// Returns every filter that is exported, of both sensors.
fn filters() -> Vec<(Sensor, EstimatorKind)> {
    let of = |sensor: fn() -> Sensor, kinds: &[EstimatorKind]| {
        kinds.iter().map(|kind| (sensor(), *kind)).collect::<Vec<_>>()
    };
    let mut all = of(sensor, &[EstimatorKind::Ekf, EstimatorKind::Hypotheses, EstimatorKind::Corrected]);
    all.extend(of(sign_split_sensor, &[EstimatorKind::SignSplit, EstimatorKind::Corrected]));
    all
}

/// Tests that the twin in double precision equals the library's filter, bit for bit and from the first row: through faults,
/// pauses of half a second to a day and rows without a reading, and on another day, when both adapt R₀.
#[test]
fn the_twin_in_double_precision_is_the_librarys_filter() {
    for ((sensor, kind), day) in filters().into_iter().flat_map(|of| [(of.clone(), 1.0), (of, 1.4)]) {
        let mut rows = faulty(rows(sensor.params()));
        for (k, pause_s) in [(100, 0.5), (300, 3.0), (400, 60.0), (500, 3600.0), (600, 86_400.0)] {
            rows[k..].iter_mut().for_each(|row| row.time_s += pause_s);
        }
        rows.iter_mut().for_each(|row| row.reading = row.reading.map(|reading| day * reading));
        rows[1200..1260].iter_mut().for_each(|row| row.reading = None);
        let estimates = twin(&sensor, kind, &rows, Protections::ALL);
        let expected = library(&mut sensor.filter().estimator(kind).build().unwrap(), &rows);
        for (k, (estimate, expected)) in estimates.iter().zip(expected).enumerate() {
            assert_eq!((estimate.mean, estimate.sd()), expected, "{}, {day}: row {k}", kind.name());
        }
    }
}

/// A protection that is turned off in the twin, and the way to turn it off in the library.
type Switch = (Protections, fn(FilterBuilder<'_>, f64) -> FilterBuilder<'_>);

const SWITCHES: [Switch; 5] = [
    (Protections { plausibility: false, ..Protections::ALL }, |row, _| row.without_plausibility()),
    (Protections { influence: false, ..Protections::ALL }, |row, _| row.influence(Influence::Full)),
    (Protections { second_look: false, ..Protections::ALL }, |row, _| row.without_second_look()),
    (Protections { following: false, ..Protections::ALL }, |row, rested| row.rest_resistance(rested)),
    (Protections { doubts: false, ..Protections::ALL }, |row, _| row.without_doubts()),
];

/// Adds faults to a recording: an unplugged sensor, a stuck number, spikes, a bad contact, and another day.
fn faulty(mut rows: Vec<RecordedRow>) -> Vec<RecordedRow> {
    for (k, row) in rows.iter_mut().enumerate() {
        row.reading = row.reading.map(|reading| match k {
            700..720 => 210_000.0,
            800..900 => 1700.5,
            950..1010 => 1.3 * reading,
            1100.. => 1.35 * reading,
            _ if k.is_multiple_of(97) => 1.5 * reading,
            _ => reading,
        });
    }
    rows
}

/// Compares twins and library filters without a protection, which differ from those with it.
#[test]
fn what_is_turned_off_is_off_in_both() {
    let sensor = sensor();
    let rows = faulty(rows(sensor.params()));
    let kind = EstimatorKind::Corrected;
    let protected = twin(&sensor, kind, &rows, Protections::ALL);
    for (protections, switch) in SWITCHES {
        let estimates = twin(&sensor, kind, &rows, protections);
        let expected = library(&mut switch(sensor.filter(), sensor.params().rested()).build().unwrap(), &rows);
        let mut unlike = 0;
        for (k, (estimate, expected)) in estimates.iter().zip(expected).enumerate() {
            assert_eq!((estimate.mean, estimate.sd()), expected, "{protections:?}: row {k}");
            let [with, without] = [protected[k], *estimate];
            let off = ((with.mean - without.mean) / without.sd()).abs().max((with.sd() / without.sd() - 1.0).abs());
            unlike += usize::from(off > 0.1);
        }
        assert!(unlike >= 20, "{protections:?}: {unlike} rows unlike with it");
    }
}
