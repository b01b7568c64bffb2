//! Two files with two clocks: the offset is found by the motion, with a correct uncertainty.

use std::fmt::Write as _;

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::import::{Align, Plan, Recipe, Survey, Table, read_table};
use ohmstrain_bench_data::simulate::{Material, SimulationSettings, simulate};

/// Offsets to be found, s: small, large, negative.
const OFFSETS: [f64; 3] = [0.217, 41.3, -7.77];

fn recording(seed: u64) -> Trace {
    let settings = SimulationSettings {
        sample_rate_hz: 10.0,
        speed_mm_s: 3.0,
        seed,
        mismatched: true,
        ..SimulationSettings::new(Material::Ecoflex0030, "mixed".parse().unwrap())
    };
    simulate(&settings).unwrap()
}

fn table(text: String, name: &str) -> Table {
    read_table(text.into_bytes(), name, &Recipe::default().read_options(0)).unwrap()
}

/// Returns the readings as one file, the reference as another whose clock shows `offset_s` less.
fn files(trace: &Trace, offset_s: f64) -> [Table; 2] {
    let (mut readings, mut reference) = ("Time (s),R (Ohm)\n".to_owned(), "t [s];Position [mm]\n".to_owned());
    let strain = &trace.reference.as_ref().unwrap().values;
    for row in 0..trace.len() {
        writeln!(readings, "{},{}", trace.time_s[row], trace.readings.values[row]).unwrap();
        writeln!(reference, "{};{}", trace.time_s[row] - offset_s, 30.0 * strain[row]).unwrap();
    }
    [table(readings, "dmm.csv"), table(reference, "stage.csv")]
}

#[test]
fn the_motion_brings_two_clocks_together() {
    let known = Recipe { align: Some(Align::Motion), gauge_length_mm: Some(30.0), ..Recipe::default() };
    for seed in 1..=3 {
        let trace = recording(seed);
        for truth in OFFSETS {
            let tables = files(&trace, truth);
            let plan = Plan::propose(&tables, &known).unwrap();
            let imported = plan.import(&tables).unwrap();
            let lag = imported.lag.unwrap();
            let seconds = -lag.lag_s;
            println!("seed {seed}: {truth} s found as {seconds:.3} ± {:.3} s", lag.sd_s);
            // Three standard deviations, and the apparent lag by the sensor's own relaxation: half a row of 0.1 s.
            assert!((seconds - truth).abs() < 3.0 * lag.sd_s + 0.05, "{lag:?} {truth}");
            assert!(lag.sd_s < 0.1, "{lag:?}");
        }
    }
}

#[test]
fn without_a_word_about_clocks_there_is_a_question() {
    let tables = files(&recording(1), 5.0);
    let known = Recipe { gauge_length_mm: Some(30.0), ..Recipe::default() };
    let question = Plan::new(&tables, &known).unwrap_err().to_string();
    assert!(question.contains("--align motion or --align none or --align SECONDS"), "{question}");
}

#[test]
fn motion_that_repeats_or_does_not_show_is_not_guessed() {
    let rows = || (0..3000).map(|k| 0.1 * f64::from(k));
    let mut reference = "t [s];Strain [%]\n".to_owned();
    rows().for_each(|t| writeln!(reference, "{t};{}", 10.0 * (1.0 - (0.5 * t).cos())).unwrap());
    let noise = |k: u64| (k.wrapping_mul(2_654_435_761).wrapping_mul(k ^ 77_777) >> 7) % 1000;
    let mut periodic = "Time (s),R (Ohm)\n".to_owned();
    let mut unrelated = periodic.clone();
    for (k, t) in rows().enumerate() {
        let spread = noise(k as u64) as f64 / 1000.0;
        writeln!(periodic, "{t},{}", 1600.0 - 300.0 * (0.5 * t).cos() + spread).unwrap();
        writeln!(unrelated, "{t},{}", 1600.0 + spread).unwrap();
    }
    let known = Recipe { align: Some(Align::Motion), ..Recipe::default() };
    for (readings, why) in [(periodic, "repeats"), (unrelated, "does not show")] {
        let tables = [table(readings, "dmm.csv"), table(reference.clone(), "stage.csv")];
        let error = Plan::new(&tables, &known).unwrap().import(&tables).unwrap_err().to_string();
        assert!(error.contains(why) && error.contains("--align SECONDS"), "{error}");
    }
}

#[test]
fn a_survey_tells_what_a_recording_is_like() {
    let trace = recording(1);
    let tables = [table(
        {
            let mut written = Vec::new();
            trace.write(&mut written).unwrap();
            String::from_utf8(written).unwrap()
        },
        "trace.csv",
    )];
    let imported = Plan::propose(&tables, &Recipe::default()).unwrap().import(&tables).unwrap();
    assert_eq!(imported.trace.readings, trace.readings, "a trace imports as itself");
    assert_eq!(imported.trace.time_s, trace.time_s);
    let survey = Survey::new(&imported);
    assert!((survey.clock.step_s - 0.1).abs() < 1e-9 && survey.clock.gaps.0 == 0);
    assert_eq!(survey.alternation, None);
    let lag = survey.lag.unwrap();
    assert!(lag.lag_s.abs() < 3.0 * lag.sd_s + 0.05, "{lag:?}");
    assert!(survey.phases.unwrap().phases.iter().all(|(count, _)| *count > 0));
}

/// Two to five similar bends, fifty rows a second, on two clocks: angles, and readings that follow them with some noise. Shifted by one
/// bend they fit equally well, except for the bend that is lost.
#[test]
fn like_movements_are_not_shifted_by_one() {
    let bend = |t: f64, k: i32| {
        let (phase, height) = ((t - 1.0 - 1.8 * f64::from(k)) / 1.4, 85.0 + 4.0 * f64::from(k * 3 % 5));
        if (0.0..1.0).contains(&phase) { 0.5 * height * (1.0 - (std::f64::consts::TAU * phase).cos()) } else { 0.0 }
    };
    let noise = |k: usize| (f64::from(u32::try_from(k * 7919 % 1000).unwrap()) / 1000.0 - 0.5) * 4.0;
    let mut found = 0;
    for (count, truth) in (2..=5).flat_map(|count| [0.0, -0.04, 0.3, -1.2, 20.0].map(|truth| (count, truth))) {
        for sign in [1.0, -1.0] {
            let lasts_s = 2.0 + 1.8 * f64::from(count);
            let times: Vec<f64> = (0..(50.0 * lasts_s) as usize).map(|k| 0.02 * k as f64).collect();
            let angle = |t: f64| (0..count).map(|k| bend(t, k)).sum::<f64>();
            let angles: Vec<f64> = times.iter().map(|t| angle(*t)).collect();
            let readings: Vec<f64> =
                times.iter().enumerate().map(|(k, t)| 1000.0 + sign * 6.0 * angle(*t) + noise(k)).collect();
            let clock: Vec<f64> = times.iter().map(|t| t + truth).collect();
            if let Ok(lag) = ohmstrain_calib::clock_lag((&clock, &readings), (&times, &angles)) {
                assert!((-lag.lag_s - truth).abs() < 3.0 * lag.sd_s + 0.05, "{count} bends: {lag:?} {truth}");
                found += 1;
            }
        }
    }
    assert!(found > 0);
}
