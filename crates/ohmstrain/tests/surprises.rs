//! Readings that surprise a filter.

use ohmstrain::{Estimate, Flag, Influence, Sensor};

fn sensor() -> Sensor {
    Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml").unwrap()).unwrap()
}

/// Twenty rows a second about one level with a noise of one ohm, of which `spike` changes one.
fn estimates(influence: Option<Influence<f64>>, spike: Option<f64>) -> Vec<Estimate> {
    let sensor = sensor();
    let builder = sensor.filter();
    let mut filter = influence.map_or(builder, |influence| builder.influence(influence)).build().unwrap();
    let reading = |k: i32| match spike {
        Some(ohm) if k == 200 => ohm,
        _ => 2000.0 + f64::from(k % 3 - 1),
    };
    (0..400).map(|k| filter.step(0.05 * f64::from(k), reading(k)).unwrap()).collect()
}

/// A spike within twice the range of calibration reaches the filter.
#[test]
fn one_spike_does_not_outlive_a_second_unless_it_is_asked_to() {
    let after = 221..400;
    let farthest = |influence| {
        let (clean, spiked) = (estimates(influence, None), estimates(influence, Some(3000.0)));
        after.clone().map(|k| (spiked[k].strain - clean[k].strain).abs() / clean[k].strain_sd).fold(0.0, f64::max)
    };
    let (robust, full) = (farthest(None), farthest(Some(Influence::Full)));
    assert!(robust < 0.5 && full > 2.0 * robust, "{robust} and {full} standard deviations");
}

#[test]
fn what_surprises_is_flagged_and_nothing_else() {
    let flagged = |rows: &[Estimate]| -> Vec<usize> {
        (0..rows.len()).filter(|&k| rows[k].flags.has(Flag::Downweighted)).collect()
    };
    assert_eq!(flagged(&estimates(None, Some(3000.0)))[..1], [200]);
    assert!(flagged(&estimates(Some(Influence::Full), Some(3000.0))).is_empty());
}

/// Zero, negative, a converter one code below its rail, an overload: none is taken, none ends the run.
#[test]
fn what_no_sensor_reads_is_as_good_as_missing() {
    for ohm in [0.0, -1600.0, 1e-3, 10.2e6, 65535e3, 9.9e37, f64::INFINITY, f64::NEG_INFINITY] {
        let (strange, missing) = (estimates(None, Some(ohm)), estimates(None, Some(f64::NAN)));
        assert!(strange[200].flags.has(Flag::Implausible), "{ohm}: {}", strange[200].flags);
        for (a, b) in strange.iter().zip(&missing) {
            assert_eq!((a.strain, a.strain_sd), (b.strain, b.strain_sd), "{ohm} at {} s", a.time_s);
        }
    }
}

/// A body at rest for ten seconds moves up by a third of the range within eight rows: a gate that waits for ten readings misses all of it.
#[test]
fn a_gate_lets_a_body_set_off() {
    let reading = |k: i32| 2000.0 + f64::from(k % 3 - 1) + 100.0 * f64::from((k - 200).clamp(0, 8));
    for gate in [3.0, 6.6, 10.8] {
        let mut filter = sensor().filter().gate(gate).build().unwrap();
        let rows: Vec<Estimate> = (0..240).map(|k| filter.step(0.05 * f64::from(k), reading(k)).unwrap()).collect();
        let rejected = rows.iter().filter(|row| row.flags.has(Flag::Rejected)).count();
        assert!((1..=2).contains(&rejected), "gate {gate}: {rejected} of eight readings are turned down");
        assert!(rows[200..208].iter().any(|row| row.flags.has(Flag::Readmitted)), "gate {gate}");
    }
}

/// Forward and smoothed: with a spike, an overload and a pause, to the last digit.
#[test]
fn a_gate_that_turns_nothing_down_is_no_gate() {
    let time_s: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
    let ohm: Vec<f64> = (0..400)
        .map(|k| match k {
            120 => 9.9e37,
            200 => 3000.0,
            300..=310 => f64::NAN,
            _ => 2000.0 + f64::from(k % 3 - 1) + 100.0 * f64::from((k - 250).clamp(0, 8)),
        })
        .collect();
    let sensor = sensor();
    let rows = |builder: ohmstrain::FilterBuilder<'_>| {
        let mut filter = builder.build().unwrap();
        let forward: Vec<Estimate> =
            time_s.iter().zip(&ohm).map(|(time_s, ohm)| filter.step(*time_s, *ohm).unwrap()).collect();
        (forward, builder.smooth(&time_s, &ohm).unwrap())
    };
    let [without, wide] = [sensor.filter(), sensor.filter().gate(1e300)].map(rows);
    let digits = |rows: &[Estimate]| rows.iter().map(|row| format!("{row:?}")).collect::<Vec<_>>();
    assert_eq!(digits(&without.0), digits(&wide.0));
    assert_eq!(digits(&without.1), digits(&wide.1));
}
