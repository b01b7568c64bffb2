//! Invalid readings: overloads, unplugged and stuck sensors. No reading ends a run.

use crate::common::{Bench, Csv, change_rows};

/// `trace.csv` with another resistance in some rows.
fn with_resistance(bench: &Bench, name: &str, rows: std::ops::Range<usize>, resistance: &str) {
    let changed = change_rows(&bench.read("trace.csv"), |row, cells| {
        if rows.contains(&row) {
            resistance.clone_into(&mut cells[1]);
        }
    });
    bench.write(name, changed);
}

fn estimates(bench: &Bench, command: &[&str], trace: &str) -> Csv {
    Csv::new(&bench.run(&[command, &[trace, "--sensor", "sensor.toml"]].concat()).ok())
}

/// An overload is flagged and otherwise the same as a missing reading, once or for a minute.
#[test]
fn an_overload_is_a_missing_reading() {
    let bench = Bench::calibrated();
    for rows in [700..701, 700..1000] {
        with_resistance(&bench, "missing.csv", rows.clone(), "");
        for overload in ["9.9E+37", "1e9", "1e7", "1e-3"] {
            with_resistance(&bench, "overload.csv", rows.clone(), overload);
            for command in [&["filter"][..], &["filter", "--gate", "12"], &["smooth"]] {
                let (missing, overloaded) =
                    (estimates(&bench, command, "missing.csv"), estimates(&bench, command, "overload.csv"));
                for column in ["strain", "strain_sd", "strain_rate", "nis"] {
                    assert!(missing.cells(column) == overloaded.cells(column), "{command:?} {overload} {column}");
                }
                let flags = overloaded.cells("flags");
                assert!(flags[rows.clone()].iter().all(|flags| flags.contains("implausible")), "{command:?}");
                assert_eq!(flags.iter().filter(|flags| flags.contains("implausible")).count(), rows.len());
            }
        }
    }
}

/// Readings that a gate rejects for two seconds do not end a run, and half a minute later the estimate is as it would have
/// been.
#[test]
fn an_unplugged_sensor_is_recovered() {
    let bench = Bench::calibrated();
    let clean = estimates(&bench, &["filter"], "trace.csv").numbers("strain");
    for resistance in ["8000", "300"] {
        with_resistance(&bench, "unplugged.csv", 700..710, resistance);
        for gate in ["3", "12", "30"] {
            let found = estimates(&bench, &["filter", "--gate", gate], "unplugged.csv");
            let (strain, sd) = (found.numbers("strain"), found.numbers("strain_sd"));
            assert_eq!(strain.len(), clean.len());
            for row in 860..clean.len() {
                assert!((strain[row] - clean[row]).abs() < 3.0 * sd[row], "{resistance} {gate} {row}");
            }
        }
    }
}

/// A reading that does not change in any digit is ignored after a while: it is flagged, and the strain becomes as uncertain as
/// without readings.
#[test]
fn a_stuck_reading_is_flagged_and_not_believed() {
    let bench = Bench::calibrated();
    let trace = Csv::new(&bench.read("trace.csv"));
    let (rows, truth) = (trace.len(), trace.numbers("strain"));
    let frozen = 1500..rows;
    with_resistance(&bench, "stuck.csv", frozen.clone(), trace.cells("resistance_ohm")[1500]);
    with_resistance(&bench, "missing.csv", frozen.start + 11..rows, "");
    for command in ["filter", "smooth"] {
        let (stuck, missing) =
            (estimates(&bench, &[command], "stuck.csv"), estimates(&bench, &[command], "missing.csv"));
        // Ten repetitions: a working sensor with this noise never shows one.
        let flags = stuck.cells("flags");
        assert!(flags[frozen.start + 11..].iter().all(|flags| flags.contains("stuck")), "{command}");
        assert!(flags[..=frozen.start + 5].iter().all(|flags| !flags.contains("stuck")), "{command}");
        let (sd, faded) = (stuck.numbers("strain_sd"), missing.numbers("strain_sd"));
        assert!((sd[rows - 1] / faded[rows - 1] - 1.0).abs() < 0.05, "{command}");
        let strain = stuck.numbers("strain");
        let covered = frozen.clone().filter(|&row| (strain[row] - truth[row]).abs() < 1.96 * sd[row]).count();
        assert!(covered as f64 > 0.9 * frozen.len() as f64, "{command}: {covered} of {}", frozen.len());
    }
}
