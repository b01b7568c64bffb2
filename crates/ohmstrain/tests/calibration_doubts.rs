//! Recordings that cannot be calibrated on as they are: which doubts they raise, and what answers them.

use ohmstrain::{CalibrationDoubt, Quantity, Recording, calibration_doubts};

const ROWS: u32 = 400;

/// A quarter of a minute of stretching and releasing by up to 30 %, from rest: times, ohms and strains.
fn bench() -> [Vec<f64>; 3] {
    let time_s: Vec<f64> = (0..ROWS).map(|k| 0.1 * f64::from(k)).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * (0.6 * t).cos() + 1e-3).collect();
    let ohm = strain.iter().map(|e| 1600.0 * (1.0 + 1.9 * e - 2.0 * e * e)).collect();
    [time_s, ohm, strain]
}

fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|value| factor * value).collect()
}

/// The doubts by their names.
fn names(recordings: &[Recording]) -> Vec<String> {
    let name = |doubt: &CalibrationDoubt| format!("{doubt:?}").split(' ').next().unwrap_or_default().to_owned();
    calibration_doubts(recordings).iter().map(name).collect()
}

#[test]
fn each_mistake_is_one_doubt() {
    let [time_s, ohm, strain] = &bench();
    let recording = |ohm, strain| Recording::new(time_s, ohm, strain).unwrap();
    assert_eq!(names(&[recording(ohm, strain)]), [""; 0]);
    for (reading, reference, expected) in [
        (ohm.clone(), scaled(strain, 100.0), "Percent"),
        (scaled(ohm, 1e-3), strain.clone(), "KiloOhm"),
        (strain.clone(), ohm.clone(), "Exchanged"),
        (scaled(strain, 100.0), ohm.clone(), "Exchanged"),
        (strain.clone(), scaled(ohm, 1e-3), "Exchanged"),
    ] {
        let wrong = [Recording::new(time_s, &reading, &reference).unwrap()];
        let doubts = calibration_doubts(&wrong);
        assert_eq!(names(&wrong), [expected]);
        assert!(doubts[0].is_refusal() && doubts[0].recordings() == [0]);
    }
    // Ratios to the resistance at rest, and angles of a joint.
    let ratio = scaled(ohm, 1.0 / 1600.0);
    let angle = scaled(strain, 300.0);
    assert_eq!(names(&[recording(&ratio, strain).of_ratios()]), [""; 0]);
    assert_eq!(names(&[recording(strain, &ratio).of_ratios()]), ["Exchanged"]);
    assert_eq!(names(&[recording(ohm, &angle).of_angles_deg()]), [""; 0]);
    assert_eq!(names(&[recording(&angle, ohm).of_angles_deg()]), ["Exchanged"]);
    assert_eq!(
        calibration_doubts(&[recording(&angle, ohm).of_angles_deg()])[0],
        CalibrationDoubt::Exchanged { recording: 0, readings: "resistance_ohm", reference: Quantity::AngleDeg.name() }
    );
}

#[test]
fn a_stated_unit_is_not_asked_about() {
    let [time_s, ohm, strain] = &bench();
    let (far, small) = (scaled(strain, 20.0), scaled(ohm, 1e-3));
    let balloon = Recording::new(time_s, ohm, &far).unwrap();
    assert_eq!(names(&[balloon]), ["Percent"]);
    assert_eq!(names(&[balloon.strain_unit_is_known()]), [""; 0]);
    let milliohm = Recording::new(time_s, &small, strain).unwrap();
    assert_eq!(names(&[milliohm.strain_unit_is_known()]), ["KiloOhm"]);
    assert_eq!(names(&[milliohm.resistance_unit_is_known()]), [""; 0]);
}

#[test]
fn recordings_are_held_against_each_other() {
    let [time_s, ohm, strain] = &bench();
    let (higher, percent) = (scaled(ohm, 30.0), scaled(strain, 0.02));
    let plain = Recording::new(time_s, ohm, strain).unwrap();
    let one = Recording::new(time_s, &higher, strain).unwrap();
    assert_eq!(names(&[plain, one]), ["ReadingsApart"]);
    assert_eq!(calibration_doubts(&[one, plain])[0].recordings(), [1, 0]);
    let small = Recording::new(time_s, ohm, &percent).unwrap();
    assert_eq!(names(&[small, plain]), ["ReferencesApart"]);
    // What stops a calibration comes first, whatever place it has.
    assert_eq!(names(&[plain, plain, small]), ["ReferencesApart", "Copy"]);
    let copy = calibration_doubts(&[plain, plain]);
    assert_eq!(copy, [CalibrationDoubt::Copy { recordings: [1, 0] }]);
    assert!(!copy[0].is_refusal());
    let stiff = scaled(strain, 0.2);
    assert_eq!(names(&[plain, Recording::new(time_s, ohm, &stiff).unwrap()]), ["GaugesApart"]);
}
