//! Slices that do not form a recording are refused, with the faulty row.

use ohmstrain_calib::{CalibrationError, LawOptions, Samples, SamplesError, fit_law};

const ROWS: usize = 80;

/// Returns a movement with a reading that follows it.
fn recording() -> [Vec<f64>; 3] {
    let time_s: Vec<f64> = (0..ROWS).map(|k| 0.1 * k as f64).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| 0.1 - 0.1 * t.cos()).collect();
    let reading = strain.iter().map(|x| 1500.0 * (1.0 + x)).collect();
    [time_s, reading, strain]
}

/// Returns the error for the recording after a change.
fn refused(change: impl Fn(&mut [Vec<f64>; 3])) -> SamplesError {
    let mut columns = recording();
    change(&mut columns);
    let [time_s, reading, strain] = &columns;
    Samples::new(time_s, reading, strain).unwrap_err()
}

#[test]
fn the_row_to_blame_is_named() {
    assert_eq!(
        refused(|columns| columns[2].truncate(70)),
        SamplesError::Lengths { times: ROWS, readings: ROWS, strains: 70 }
    );
    assert!(matches!(refused(|columns| columns[0][7] = f64::NAN), SamplesError::Time { row: 7, .. }));
    assert!(matches!(refused(|columns| columns[0][9] = 0.05), SamplesError::Order { row: 9, time_s: 0.05, .. }));
    assert!(matches!(refused(|columns| columns[0][5] = columns[0][4]), SamplesError::Order { row: 5, .. }));
    assert_eq!(refused(|columns| columns[1][3] = -1.0), SamplesError::Reading { row: 3, reading: -1.0 });
    assert_eq!(refused(|columns| columns[1][3] = 0.0), SamplesError::Reading { row: 3, reading: 0.0 });
    assert!(matches!(refused(|columns| columns[1][2] = f64::INFINITY), SamplesError::Reading { row: 2, .. }));
    assert!(matches!(refused(|columns| columns[2][1] = f64::NEG_INFINITY), SamplesError::Strain { row: 1, .. }));
    let message = refused(|columns| columns[0][5] = columns[0][4]).to_string();
    assert_eq!(message, "row 5: expected a time after 0.4 s, found 0.4 s");
}

#[test]
fn missing_values_are_no_fault() {
    let [time_s, mut reading, mut strain] = recording();
    (reading[4], strain[0]) = (f64::NAN, f64::NAN);
    let samples = Samples::new(&time_s, &reading, &strain).unwrap();
    assert_eq!((samples.len(), samples.complete_rows().count()), (ROWS, ROWS - 2));
    assert_eq!(samples.time_s(), time_s);
}

#[test]
fn nothing_is_learned_where_nothing_moves() {
    let [time_s, reading, strain] = recording();
    let still = vec![0.1; ROWS];
    let fit = |reading: &[f64], strain: &[f64]| {
        fit_law(&[Samples::new(&time_s, reading, strain).unwrap()], LawOptions::default()).unwrap_err()
    };
    assert_eq!(fit(&reading, &still), CalibrationError::ConstantStrain);
    assert_eq!(fit(&still, &strain), CalibrationError::ConstantReading);
}
