//! References from marks, against motions written down in the test.

use ohmstrain_calib::{Mark, MarksError, Samples, marked_references};

const STEP_S: f64 = 0.1;
/// Time constant of the relaxation, s. In a rest of 5 s its second half is exp(-2.5/3) = 0.43 of the first. Holds much shorter than the
/// relaxation cannot be distinguished from slow moves.
const RELAXATION_S: f64 = 3.0;

/// Returns the resistance of a sensor that relaxes with one time constant, by explicit Euler steps and without code of the library.
fn resistance(strain: &[f64]) -> Vec<f64> {
    let mut slow = strain[0];
    let relaxed = |&x: &f64| {
        slow += (x - slow) * STEP_S / RELAXATION_S;
        1600.0 * (1.0 + 1.5 * x + 0.5 * (x - slow))
    };
    strain.iter().map(relaxed).collect()
}

/// Returns a repeated motion at constant speed: to 0.2 in 3 s, a hold of `held_s`, back in 3 s, a rest of 5 s.
fn strain(time_s: f64, held_s: f64) -> f64 {
    let in_cycle = time_s % (11.0 + held_s);
    let up = (in_cycle - 5.0) / 3.0;
    let down = (in_cycle - 8.0 - held_s) / 3.0;
    0.2 * (up.clamp(0.0, 1.0) - down.clamp(0.0, 1.0))
}

#[test]
fn holds_are_found_and_the_motion_between_them() {
    let held_s = 6.0;
    let time_s: Vec<f64> = (0..1700).map(|k| STEP_S * f64::from(k)).collect();
    let truth: Vec<f64> = time_s.iter().map(|t| strain(*t, held_s)).collect();
    let ohm = resistance(&truth);
    // One mark in each rest and each hold, with errors of up to 0.2 s and 2 % of the span.
    let marks: Vec<Mark> = (0..10)
        .flat_map(|cycle| {
            let (start, off) = (17.0 * f64::from(cycle), [0.2, -0.1, 0.1, -0.2][cycle as usize % 4]);
            let wrong = 0.02 * off;
            [Mark::new(start + 2.5 + off, wrong), Mark::new(start + 11.0 - off, 0.2 - wrong)]
        })
        .collect();
    let unknown = vec![f64::NAN; time_s.len()];
    let samples = Samples::new(&time_s, &ohm, &unknown).unwrap();
    let found = marked_references(&[samples], std::slice::from_ref(&marks)).unwrap().remove(0);
    assert_eq!(found.holds, 20);
    let known: Vec<usize> = (0..time_s.len()).filter(|&k| found.strain[k].is_finite()).collect();
    let squares = known.iter().map(|&k| (found.strain[k] - truth[k]).powi(2)).sum::<f64>();
    let error = (squares / known.len() as f64).sqrt() / 0.2;
    // Ends of holds are known to 0.6 s. At a third of the span per second that is a fifth of the span during the moves, which take 6 s of
    // 17 s: 0.119 over all.
    assert!(error < 0.119, "{error}");
    // Straight lines from mark to mark contain no holds.
    let line = |t: f64| {
        let next = marks.partition_point(|mark| mark.time_s < t).clamp(1, marks.len() - 1);
        let (a, b) = (marks[next - 1], marks[next]);
        a.strain + (b.strain - a.strain) * ((t - a.time_s) / (b.time_s - a.time_s)).clamp(0.0, 1.0)
    };
    let squares = known.iter().map(|&k| (line(time_s[k]) - truth[k]).powi(2)).sum::<f64>();
    let of_lines = (squares / known.len() as f64).sqrt() / 0.2;
    assert!(error < 0.5 * of_lines, "{error}, lines {of_lines}");
    let covered = known.iter().filter(|&&k| (found.strain[k] - truth[k]).abs() <= 2.0 * found.strain_sd[k]).count();
    assert!(covered as f64 > 0.9 * known.len() as f64, "{covered} of {}", known.len());
}

#[test]
fn the_mark_to_blame_is_named() {
    let time_s: Vec<f64> = (0..200).map(|k| STEP_S * f64::from(k)).collect();
    let ohm: Vec<f64> = time_s.iter().map(|t| 1600.0 + t).collect();
    let recording = Samples::new(&time_s, &ohm, &time_s).unwrap();
    let fault = |marks: &[Mark]| match marked_references(&[recording], &[marks.to_vec()]) {
        Err(ohmstrain_calib::CalibrationError::Marks { source, .. }) => source,
        other => panic!("{other:?}"),
    };
    assert!(matches!(marked_references(&[recording], &[]), Err(ohmstrain_calib::CalibrationError::Unsupported(_))));
    assert_eq!(fault(&[Mark::new(1.0, 0.0)]), MarksError::TooFew { found: 1 });
    assert_eq!(fault(&[Mark::new(1.0, 0.1), Mark::new(2.0, 0.1)]), MarksError::OneStrain { strain: 0.1 });
    assert_eq!(fault(&[Mark::new(1.0, 0.0), Mark::new(99.0, 0.1)]).mark(), Some(1));
    let held = Mark { until_s: Some(5.0), ..Mark::new(1.0, 0.0) };
    let overlap = MarksError::Overlap { mark: 1, time_s: 4.0, before_s: 5.0 };
    assert_eq!(fault(&[held, Mark::new(4.0, 0.1)]), overlap);
    assert_eq!(fault(&[Mark::new(1.0, f64::NAN), Mark::new(4.0, 0.1)]).mark(), Some(0));
}
