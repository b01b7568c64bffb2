//! Intervals that are wider than the filter states, and the flags with the reason.

use ohmstrain::{Estimate, EstimatorKind, Filter, Flag, Reading, Sensor};

/// Calibrated on 200 s, with readings of 1599 to 3703 ohms.
fn sensor() -> Sensor {
    sensor_that_saw("")
}

/// The same, of whose calibration these lines say more.
fn sensor_that_saw(more: &str) -> Sensor {
    let text = std::fs::read_to_string("examples/sensor.toml").unwrap();
    let line = "longest_repeat_s = 0.0\n";
    assert!(text.contains(line));
    Sensor::from_toml(&text.replace(line, &format!("{line}{more}"))).unwrap()
}

/// Twenty rows a second of a level with a noise of one ohm, from `from` on.
fn run(filter: &mut Filter, rows: std::ops::Range<i32>, ohm: f64) -> Vec<Estimate> {
    rows.map(|k| filter.step(0.05 * f64::from(k), ohm + f64::from(k % 3 - 1)).unwrap()).collect()
}

/// Rows with a flag.
fn flagged(rows: &[Estimate], flag: Flag) -> usize {
    rows.iter().filter(|row| row.flags.has(flag)).count()
}

/// The deviation that doubts add to the one that is stated.
fn more((doubted, stated): &(Estimate, Estimate)) -> f64 {
    (doubted.strain_sd.powi(2) - stated.strain_sd.powi(2)).sqrt()
}

/// Returns the same rows with and without doubts.
fn both(of: impl Fn(&mut Filter) -> Vec<Estimate>) -> Vec<(Estimate, Estimate)> {
    let sensor = sensor();
    let mut filters = [sensor.filter(), sensor.filter().without_doubts()].map(|builder| builder.build().unwrap());
    let [doubted, stated] = filters.each_mut().map(of);
    doubted.into_iter().zip(stated).collect()
}

/// A tenth of the span, 0.0333, at the start, of which exp(-4/5) is left as variance after four seconds, and nothing after sixty.
#[test]
fn a_start_is_doubted_for_seconds() {
    let rows = both(|filter| run(filter, 0..1200, 2000.0));
    let expected = |seconds: f64| 0.033333 * (-0.5 * seconds / 5.0).exp();
    for k in [0, 80] {
        let more = more(&rows[k]);
        assert!((more / expected(0.05 * k as f64) - 1.0).abs() < 1e-6, "{k}: {more}");
    }
    assert!((rows[1199].0.strain_sd / rows[1199].1.strain_sd - 1.0).abs() < 1e-3);
    let (doubted, stated): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    assert!(doubted[0].flags.has(Flag::StartUp) && !doubted[1199].flags.has(Flag::StartUp));
    assert_eq!(flagged(&stated, Flag::StartUp), 0);
}

#[test]
fn a_strain_that_is_known_is_not_doubted() {
    let sensor = sensor();
    let mut known = sensor.filter().initial_strain(0.1).build().unwrap();
    assert_eq!(flagged(&run(&mut known, 0..100, 2000.0), Flag::StartUp), 0);
    let mut given = sensor.filter().build().unwrap();
    let before = run(&mut given, 0..20, 2000.0)[19];
    let after = given.know(0.1, 0.002).unwrap();
    assert!(before.strain_sd > 10.0 * after.strain_sd);
    assert_eq!(flagged(&run(&mut given, 20..40, 2000.0), Flag::StartUp), 0);
}

/// A pause of t seconds is doubted as a start is, by (1 - exp(-t/5 s))² of its deviation, for seconds: written here by one's own
/// exponentials.
#[test]
fn a_pause_is_doubted_by_its_length_however_it_is_written_down() {
    for (pause, written_down) in [0.05, 1.0, 20.0, 7200.0].into_iter().flat_map(|s| [(s, true), (s, false)]) {
        let rows = both(|filter| {
            let mut rows = run(filter, 0..1200, 2000.0);
            let (last_s, empty) = (0.05 * 1199.0, if written_down { (pause / 0.05) as i32 } else { 0 });
            (1..=empty.min(2000)).for_each(|k| {
                filter.step(last_s + pause * f64::from(k) / f64::from(empty.min(2000) + 1), None).unwrap();
            });
            let after = |k: i32| (last_s + pause + 0.05 * f64::from(k), 2000.0 + f64::from(k % 3 - 1));
            rows.extend((0..600).map(after).map(|(time_s, ohm)| filter.step(time_s, ohm).unwrap()));
            rows
        });
        let share = (1.0 - (-pause / 5.0).exp()).powi(2);
        // What is left of the start itself, too, after a short pause.
        let started = 0.033333 * (-0.5 * (0.05 * 1199.0 + pause) / 5.0).exp();
        let found = more(&rows[1200]);
        assert!((found - (0.033333 * share).max(started)).abs() < 1e-4 * 0.0333, "{pause} s: {found} for {share}");
        // It is worth a flag from a fifth of the stated variance on.
        let stated = rows[1200].1.strain_sd;
        assert_eq!(rows[1200].0.flags.has(Flag::Recovering), found * found > 0.2 * stated * stated, "{pause} s");
        let last = rows.last().unwrap();
        assert!((last.0.strain_sd / last.1.strain_sd - 1.0).abs() < 0.01 && !last.0.flags.has(Flag::Recovering));
    }
}

/// The sensor, with a pull toward its mean strain that leaves too little, as fits to readings without a pause have it.
fn pulled() -> Sensor {
    let mut params = sensor().params().clone();
    params.estimators.values_mut().for_each(|estimator| estimator.motion.strain_sd = 0.02);
    Sensor::from_params(params).unwrap()
}

/// True if all of the intervals hold any strain that calibration has seen.
fn hold_all(rows: &[Estimate]) -> bool {
    let ends = [0.0, 0.33333];
    rows.iter().all(|row| ends.iter().all(|end| (row.strain - end).abs() < 1.96 * row.strain_sd))
}

/// Six hours with a row every ten seconds: what stands still at an end of what calibration has seen is not in the middle for want of
/// readings; it is not far outside either.
#[test]
fn hours_without_a_reading_tell_nothing() {
    let sensor = pulled();
    let ekf = || sensor.filter().estimator(EstimatorKind::Ekf);
    for ohm in [1600.0, 3600.0] {
        let pause = |builder: ohmstrain::FilterBuilder<'_>, value: Option<f64>| {
            let mut filter = builder.build().unwrap();
            run(&mut filter, 0..1200, ohm);
            let mut step = |k: u32| filter.step(60.0 + if k < 20 { 0.05 } else { 10.0 } * f64::from(k), value).unwrap();
            (0..2160).map(&mut step).collect::<Vec<_>>().split_off(20)
        };
        for value in [None, Some(ohm)] {
            let rows = pause(ekf(), value);
            assert!(hold_all(&rows), "{ohm} {value:?}");
            // √(1/12 + 1/4) spans, if the estimate were at an end of them.
            assert!(rows.iter().all(|row| row.strain_sd < 0.58 * 0.33333));
        }
        // The pull by itself.
        assert!(!hold_all(&pause(ekf().without_doubts(), None)[2139..]), "{ohm}");
    }
}

/// A strain that is read before and after a pause is as well known at both of its ends as the smoother states, and anywhere between.
#[test]
fn a_smoother_knows_both_ends_of_a_pause() {
    let sensor = pulled();
    let ekf = || sensor.filter().estimator(EstimatorKind::Ekf);
    // Rows of 0.05 s, for a minute, but for an hour of every second; the last hour has no end.
    let time_s: Vec<f64> = (0..1200)
        .map(|k| 0.05 * f64::from(k))
        .chain((0..3600).map(|k| 60.0 + f64::from(k)))
        .chain((0..1200).map(|k| 3660.0 + 0.05 * f64::from(k)))
        .chain((0..3600).map(|k| 3720.0 + f64::from(k)))
        .collect();
    let reading = |k: usize| if k % 4800 < 1200 { 1600.0 + (k % 3) as f64 } else { f64::NAN };
    let readings: Vec<f64> = (0..time_s.len()).map(reading).collect();
    let rows = ekf().smooth(&time_s, &readings).unwrap();
    assert!(hold_all(&rows[1260..4740]) && hold_all(&rows[6060..]));
    let stated = ekf().without_doubts().smooth(&time_s, &readings).unwrap();
    assert!(!hold_all(&stated[3000..3001]) && !hold_all(&stated[9000..]));
    // The doubt about the start is at most the squared range of the strain, and decays with 5 s.
    for k in [600, 1200, 4799, 4800, 6000] {
        let wider = rows[k].strain_sd.powi(2) - stated[k].strain_sd.powi(2);
        let of_start = 0.33333_f64.powi(2) * (-time_s[k] / 5.0).exp();
        assert!((0.0..=of_start + 1e-15).contains(&wider), "{k}: {wider} {of_start}");
    }
}

/// A jump that the filter does not expect: at once it states nearly what it stated before, while it may be the contacts.
#[test]
fn a_jump_is_doubted() {
    let rows = both(|filter| {
        let mut rows = run(filter, 0..800, 2000.0);
        rows.extend(run(filter, 800..820, 3000.0));
        rows
    });
    assert!(rows[801].0.flags.has(Flag::Recovering), "{}", rows[801].0.flags);
    // 1000 Ω of the calibration's 2104 are 0.158 of strain; most of that is a surprise.
    assert!((0.08..0.159).contains(&more(&rows[801])), "{}", more(&rows[801]));
    assert_eq!(flagged(&rows[..800].iter().map(|row| row.0).collect::<Vec<_>>(), Flag::Recovering), 0);
}

/// 4001 Ω are 298 Ω beyond the calibration's 2104, of which a fiftieth is free; the rest counts one and a half times: 0.182 of the
/// span.
#[test]
fn readings_outside_of_calibration_widen_the_interval() {
    let rows = both(|filter| run(filter, 0..1200, 4000.0));
    let expected = 1.5 * 0.33333 * ((4000.0 + 1.0 - 3703.107) / (3703.107 - 1598.905) - 0.02);
    let more = more(&rows[1199]);
    assert!((more / expected - 1.0).abs() < 0.01, "{more} {expected}");
    assert!(rows[1199].0.flags.has(Flag::Extrapolated) && !rows[1199].1.flags.has(Flag::Extrapolated));
}

/// A smoother's rows are doubted for what comes after them: half a minute before it exp(-1/2) of it is left.
#[test]
fn a_smoother_doubts_what_comes_before_readings_outside_of_calibration() {
    let sensor = sensor();
    let time_s: Vec<f64> = (0..2400).map(|k| 0.05 * f64::from(k)).collect();
    let reading = |k: usize| if k < 1200 { 2000.0 } else { 4000.0 } + (k % 3) as f64 - 1.0;
    let readings: Vec<f64> = (0..time_s.len()).map(reading).collect();
    let rows = sensor.smooth(&time_s, &readings).unwrap();
    let stated = sensor.filter().without_doubts().smooth(&time_s, &readings).unwrap();
    let expected = 1.5 * 0.33333 * ((4000.0 + 1.0 - 3703.107) / (3703.107 - 1598.905) - 0.02);
    for (k, share) in [(2399, 1.0), (600, (-0.5_f64).exp())] {
        // Innovations of the jump are far from row 600, twenty seconds being as long as they matter, and of the last rows small.
        let more = more(&(rows[k], stated[k]));
        assert!((more / (share * expected) - 1.0).abs() < 0.03, "{k}: {more}");
    }
}

#[test]
fn a_long_run_is_flagged_where_readings_drifted() {
    for (drifts, is_long) in [("drifts = true\n", true), ("", false)] {
        let mut filter = sensor_that_saw(drifts).filter().build().unwrap();
        let mut long = |time_s: f64| filter.step(time_s, 2000.0).unwrap().flags.has(Flag::LongRun);
        assert_eq!([10.0, 209.0, 211.0].map(&mut long), [false, false, is_long]);
    }
}

/// One number for a minute, twenty rows a second, with a converter's error. A meter of whole ohms with noise of a tenth of one gives it, and so does a
/// converter whose step, 5 ohms, is sixteen times the noise; one of half an ohm does so for 300 rows by chance, and a fine
/// meter not ten times.
#[test]
fn a_still_sensor_repeats_coarse_numbers() {
    let (whole, fine) = ("step = 1.0\nnoise_sd = 0.1\n", "step = 0.001\nnoise_sd = 0.3\n");
    let cases = [
        (whole, 0.0, None),
        (fine, 5.0 / 12.0_f64.sqrt(), None),
        (fine, 0.5 / 12.0_f64.sqrt(), Some(300)),
        (fine, 0.0, Some(10)),
    ];
    for (resolution, sd, first) in cases {
        let mut filter = sensor_that_saw(&format!("\n[validity.resolution]\n{resolution}")).filter().build().unwrap();
        let stuck = |k: i32| {
            let row = filter.step(0.05 * f64::from(k), Reading { value: 1600.0, sd, saturated: false }).unwrap();
            row.flags.has(Flag::Stuck)
        };
        assert_eq!((0..1200).map(stuck).position(|is_stuck| is_stuck), first, "{resolution} {sd}");
    }
}

/// Calibrated where the rested sensor read 1599.83 ohms. Another day's reads a tenth more: 160 of calibration's 2104 ohms for
/// 0.33333 of strain. Not told that it rests, it may as well be stretched.
#[test]
fn a_rest_unlike_calibrations_is_doubted_until_it_is_given() {
    let sensor = sensor();
    let today = 1.1 * 1599.83;
    let run_from = |known: Option<f64>| {
        let builder = known.map_or(sensor.filter(), |strain| sensor.filter().initial_strain(strain));
        let mut filter = builder.build().unwrap();
        let mut rows = run(&mut filter, 0..1200, today);
        filter.rest_resistance(today).unwrap();
        rows.extend(run(&mut filter, 1200..1300, today));
        rows
    };
    let rows = run_from(Some(0.0));
    assert_eq!(flagged(&rows, Flag::RestMoved), 1200);
    let bare = sensor.filter().initial_strain(0.0).without_doubts();
    let stated = run(&mut bare.build().unwrap(), 0..1200, today);
    let expected = 0.1 * 1599.83 * 0.33333 / (3703.107 - 1598.905);
    let more = more(&(rows[1199], stated[1199]));
    assert!((more / expected - 1.0).abs() < 0.01, "{more} {expected}");
    for known in [None, Some(0.1)] {
        assert_eq!(flagged(&run_from(known), Flag::RestMoved), 0);
    }
    // 4 % more are as little as nothing.
    let mut near = sensor.filter().initial_strain(0.0).build().unwrap();
    assert_eq!(flagged(&run(&mut near, 0..100, 1.04 * 1599.83), Flag::RestMoved), 0);
}

/// No strain leads below what was read at rest: after ten seconds there R₀ is another one, and it is calibration's again once
/// the sensor has rested for ten seconds where it did then. A wire that is off for less says nothing.
#[test]
fn readings_that_stay_below_rest_tell_of_another_r0() {
    let mut filter = sensor().filter().build().unwrap();
    let mut rows = run(&mut filter, 0..100, 2000.0);
    rows.extend(run(&mut filter, 100..280, 0.9 * 1599.83));
    rows.extend(run(&mut filter, 280..380, 2000.0));
    assert_eq!(flagged(&rows, Flag::RestMoved), 0);
    rows.extend(run(&mut filter, 380..700, 0.9 * 1599.83));
    rows.extend(run(&mut filter, 700..900, 2000.0));
    // The 200th row below it has been there for 10 s, to a rounding of the times.
    assert!(rows[..579].iter().all(|row| !row.flags.has(Flag::RestMoved)));
    assert!(rows[581..].iter().all(|row| row.flags.has(Flag::RestMoved)));
    let rows = run(&mut filter, 900..1200, 1599.83);
    assert!(rows[190].flags.has(Flag::RestMoved) && !rows[210].flags.has(Flag::RestMoved));
}
