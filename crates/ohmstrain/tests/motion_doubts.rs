//! References that cannot be what the readings show: which doubts they raise, and which recordings raise none.

use ohmstrain::{CalibrationDoubt, Recording, motion_doubts};

/// 100 s, ten rows a second, of strokes of 10 s between 0 and 30 %, and readings with a relaxation of 3 s.
fn bench() -> [Vec<f64>; 3] {
    let time_s: Vec<f64> = (0..1000).map(|k| 0.1 * f64::from(k)).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * (0.2 * std::f64::consts::PI * t).cos()).collect();
    let ohm = ohms(&strain);
    [time_s, ohm, strain]
}

/// Readings that follow the strain, and what relaxes of its changes.
fn ohms(strain: &[f64]) -> Vec<f64> {
    let (mut relaxing, mut before) = (0.0, strain[0]);
    let reading = |e: &f64| {
        relaxing = relaxing * (-0.1_f64 / 3.0).exp() + 0.8 * (e - before).abs();
        before = *e;
        1600.0 * (1.0 + 1.9 * e + relaxing)
    };
    strain.iter().map(reading).collect()
}

fn names(recordings: &[Recording]) -> Vec<String> {
    let name = |doubt: &CalibrationDoubt| format!("{doubt:?}").split(' ').next().unwrap_or_default().to_owned();
    assert!(motion_doubts(recordings).iter().all(CalibrationDoubt::is_refusal));
    motion_doubts(recordings).iter().map(name).collect()
}

#[test]
fn a_reference_that_stands_still_while_readings_swing_is_asked_about() {
    let [time_s, ohm, strain] = bench();
    assert_eq!(names(&[Recording::new(&time_s, &ohm, &strain).unwrap()]), [""; 0]);
    // Of the whole recording a minute, and only eight seconds.
    for (from, to) in [(200, 800), (400, 480)] {
        let mut frozen = strain.clone();
        frozen[from..to].fill(0.0);
        let doubts = motion_doubts(&[Recording::new(&time_s, &ohm, &frozen).unwrap()]);
        let [CalibrationDoubt::Frozen { recording: 0, from_s, to_s, reference: 0.0, .. }] = doubts[..] else {
            panic!("{doubts:?}")
        };
        assert!((from_s - time_s[from]).abs() < 0.2 && (to_s - time_s[to]).abs() < 0.2, "{from_s} {to_s}");
    }
}

/// Readings that relax in a hold, and after a release, go one way.
#[test]
fn holds_and_rests_raise_no_doubt() {
    let time_s: Vec<f64> = (0..2000).map(|k| 0.1 * f64::from(k)).collect();
    let level = |t: f64| if (t % 100.0) < 50.0 { 0.0 } else { 0.3 };
    let strain: Vec<f64> = (0..2000).map(|k| level(0.1 * f64::from(k))).collect();
    let noisy: Vec<f64> = ohms(&strain).iter().enumerate().map(|(k, ohm)| ohm + [0.0, 3.0, -3.0][k % 3]).collect();
    assert_eq!(names(&[Recording::new(&time_s, &noisy, &strain).unwrap()]), [""; 0]);
}

#[test]
fn a_reference_of_the_other_sign_is_asked_about() {
    let [time_s, ohm, strain] = bench();
    let turned: Vec<f64> = strain.iter().map(|e| -e).collect();
    let wrong = Recording::new(&time_s, &ohm, &turned).unwrap();
    assert_eq!(names(&[wrong]), ["Turned"]);
    assert_eq!(names(&[wrong.strain_unit_is_known()]), [""; 0]);
    assert_eq!(names(&[wrong.of_angles_deg()]), [""; 0]);
    // Around zero one recording does not tell, two do.
    let [around, against] = [1.0, -1.0].map(|sign| strain.iter().map(|e| sign * (e - 0.15)).collect::<Vec<f64>>());
    let pair = [&around, &against].map(|strain| Recording::new(&time_s, &ohm, strain).unwrap());
    assert_eq!(names(&pair[..1]), [""; 0]);
    assert_eq!(names(&pair), ["TurnedApart"]);
    assert_eq!(motion_doubts(&pair)[0].recordings(), [1, 0]);
}

#[test]
fn a_clock_in_milliseconds_is_asked_about() {
    let [time_s, ohm, strain] = bench();
    let milliseconds: Vec<f64> = time_s.iter().map(|t| (1e3 * t).round()).collect();
    let wrong = Recording::new(&milliseconds, &ohm, &strain).unwrap();
    assert_eq!(names(&[wrong]), ["Milliseconds"]);
    assert_eq!(names(&[wrong.clock_is_known()]), [""; 0]);
    // A row each ten seconds of a long hold is nothing of the kind.
    let slow: Vec<f64> = (0..1000).map(|k| 10.0 * f64::from(k)).collect();
    let held: Vec<f64> = (0..1000).map(|k| if k < 500 { 0.0 } else { 0.2 }).collect();
    assert_eq!(names(&[Recording::new(&slow, &ohms(&held), &held).unwrap()]), [""; 0]);
}
