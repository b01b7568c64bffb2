//! A row without a reading says nothing: estimates are the same whether it is there or not.

use ohmstrain::{Estimate, EstimatorKind, FilterBuilder, Flag, Sensor};

/// Times, s, and readings.
type Rows = [(f64, Option<f64>)];

fn sensor() -> Sensor {
    Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml").unwrap()).unwrap()
}

/// Readings of 1600 to 3400 ohms that go up and down, twenty a second for 100 s, and none where `is_lost` says so.
fn recording(is_lost: impl Fn(usize) -> bool) -> Vec<(f64, Option<f64>)> {
    let reading = |k: usize| 2500.0 + 900.0 * (0.4 * 0.05 * k as f64).sin() + (k % 3) as f64;
    (0..2000).map(|k| (0.05 * k as f64, (k == 0 || !is_lost(k)).then(|| reading(k)))).collect()
}

/// One row in a hundred, every other one, and pauses of 25 s and less.
fn losses() -> [fn(usize) -> bool; 3] {
    [|k| k * 61 % 100 == 0, |k| k % 2 == 1, |k| (400..900).contains(&k) || k % 50 > 45]
}

fn filtered(builder: FilterBuilder<'_>, rows: &Rows) -> Vec<Estimate> {
    let mut filter = builder.build().unwrap();
    rows.iter().map(|&(time_s, ohm)| filter.step(time_s, ohm).unwrap()).collect()
}

fn lagged(builder: FilterBuilder<'_>, rows: &Rows) -> Vec<Estimate> {
    let mut filter = builder.build_lagged(0.5).unwrap();
    let mut out = Vec::new();
    rows.iter().for_each(|&(time_s, ohm)| out.extend_from_slice(filter.step(time_s, ohm).unwrap()));
    out.extend_from_slice(filter.finish().unwrap());
    out
}

fn smoothed(builder: FilterBuilder<'_>, rows: &Rows) -> Vec<Estimate> {
    let (time_s, ohm): (Vec<f64>, Vec<f64>) =
        rows.iter().map(|(time_s, ohm)| (*time_s, ohm.unwrap_or(f64::NAN))).unzip();
    builder.smooth(&time_s, &ohm).unwrap()
}

/// Asserts that rows with a reading say the same, to the bit, with the others empty and with the others cut.
fn assert_alike(kind: EstimatorKind, run: fn(FilterBuilder<'_>, &Rows) -> Vec<Estimate>) {
    let sensor = sensor();
    for (of, is_lost) in losses().into_iter().enumerate() {
        let rows = recording(is_lost);
        let cut: Vec<_> = rows.iter().copied().filter(|row| row.1.is_some()).collect();
        let empty = run(sensor.filter().estimator(kind), &rows);
        assert_eq!(empty.len(), rows.len());
        let read = empty.iter().filter(|row| row.resistance.is_some());
        for (found, expected) in read.zip(run(sensor.filter().estimator(kind), &cut)) {
            assert_eq!(*found, expected, "{kind:?}, loss {of}, {} s", expected.time_s);
        }
    }
}

#[test]
fn filters_say_the_same_whether_empty_rows_are_there() {
    [EstimatorKind::Ekf, EstimatorKind::SignSplit].into_iter().for_each(|kind| assert_alike(kind, filtered));
}

#[test]
fn smoothers_say_the_same_whether_empty_rows_are_there() {
    for kind in [EstimatorKind::Ekf, EstimatorKind::SignSplit] {
        assert_alike(kind, lagged);
        assert_alike(kind, smoothed);
    }
}

/// One reading in a hundred is lost: what is doubted beyond what the filter states stays what it is without losses, and no row is
/// flagged that was not. A pause of two rows, 0.1 s, is doubted by (1 - exp(-0.02))² of a start's deviation: less than a thousandth.
#[test]
fn a_lost_reading_raises_no_doubt() {
    let sensor = sensor();
    let lost = recording(losses()[0]);
    let widening = |rows: &Rows| -> (f64, Vec<f64>) {
        let [doubted, stated] =
            [sensor.filter(), sensor.filter().without_doubts()].map(|builder| filtered(builder, rows));
        let read = || (0..rows.len()).filter(|k| lost[*k].1.is_some());
        let sd = |rows: &[Estimate]| read().map(|k| rows[k].strain_sd).sum::<f64>();
        let flagged = read().filter(|k| doubted[*k].flags.has(Flag::Recovering)).map(|k| doubted[k].time_s);
        (sd(&doubted) / sd(&stated), flagged.collect())
    };
    let ((some, some_flagged), (all, all_flagged)) = (widening(&lost), widening(&recording(|_| false)));
    assert!((some / all - 1.0).abs() < 1e-3, "{some} for {all}");
    assert_eq!(some_flagged, all_flagged);
}
