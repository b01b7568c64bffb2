//! Faults occur where they are specified, and nowhere else.

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::faults::{Episode, Fault};
use ohmstrain_bench_data::simulate::{Disturbances, Material, Protocol, SimulationSettings, simulate};

const FROM_S: f64 = 20.0;
const UNTIL_S: f64 = 30.0;
/// Rows with the fault, at 20 rows a second.
const ROWS: std::ops::Range<usize> = 400..600;

fn trace() -> Trace {
    let quiet = Disturbances { white_sd: 0.0, ..Disturbances::BENCH };
    let settings = SimulationSettings::new(Material::Ecoflex0030, Protocol::EXTEND_RETRACT);
    simulate(&SimulationSettings { disturbances: quiet, ..settings }).unwrap()
}

fn with(fault: Fault, seed: u64) -> Trace {
    Episode { fault, from_s: FROM_S, until_s: UNTIL_S, seed }.put_into(&trace())
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

const OF_READINGS: [Fault; 12] = [
    Fault::Dropout { share: 0.5 },
    Fault::Burst { sd: 0.1 },
    Fault::Spike { factor: 10.0 },
    Fault::Spikes { share: 0.1, factor: 10.0 },
    Fault::Stuck,
    Fault::Saturation { share: 0.5 },
    Fault::UnpluggedHigh { reading: 1e9 },
    Fault::UnpluggedLow { reading: 1.0 },
    Fault::BaselineStep { share: 0.1 },
    Fault::GainChange { factor: 1.5 },
    Fault::PolarityFlip,
    Fault::WrongRest { factor: 1.2 },
];

#[test]
fn a_fault_of_the_readings_changes_some_of_its_rows_and_no_other() {
    let clean = trace();
    for fault in OF_READINGS {
        let faulty = with(fault, 1);
        assert_eq!((&faulty.time_s, &faulty.reference), (&clean.time_s, &clean.reference), "{fault:?}");
        let (a, b) = (bits(&clean.readings.values), bits(&faulty.readings.values));
        let changed: Vec<usize> = (0..clean.len()).filter(|&k| a[k] != b[k]).collect();
        assert!(!changed.is_empty() && changed.iter().all(|row| ROWS.contains(row)), "{fault:?}: {changed:?}");
        assert_eq!(b, bits(&with(fault, 1).readings.values), "{fault:?}: the same seed");
    }
}

/// A fraction p of 200 rows is hit, within five standard deviations, √(200 p (1 - p)), of 200 p; another seed hits other
/// rows.
#[test]
fn shares_are_kept_by_chance() {
    let clean = trace();
    for (share, most_off) in [(0.5, 5.0 * 50.0_f64.sqrt()), (0.1, 5.0 * 18.0_f64.sqrt())] {
        let hit = |seed: u64| {
            let missing = with(Fault::Dropout { share }, seed).readings.values;
            (0..missing.len()).filter(|&k| missing[k].is_nan()).collect::<Vec<_>>()
        };
        assert!((hit(1).len() as f64 - 200.0 * share).abs() < most_off, "{share}: {}", hit(1).len());
        assert_ne!(hit(1), hit(2));
    }
    let spiked = with(Fault::Spike { factor: 10.0 }, 1).readings.values;
    assert_eq!(spiked[ROWS.start], 10.0 * clean.readings.values[ROWS.start]);
}

#[test]
fn what_is_read_is_what_the_fault_says() {
    let clean = trace().readings.values;
    let of = |fault| with(fault, 1).readings.values;
    let low = clean.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(of(Fault::Stuck)[ROWS].iter().all(|ohm| *ohm == clean[ROWS.start - 1]));
    for k in ROWS {
        let near = |a: f64, b: f64| (a - b).abs() <= 4.0 * f64::EPSILON * b.abs().max(low);
        assert!(near(of(Fault::PolarityFlip)[k] - low, low - clean[k]));
        assert!(near(of(Fault::BaselineStep { share: 0.1 })[k], clean[k] + 0.1 * low));
    }
}

#[test]
fn a_fault_of_the_clock_keeps_rows_together() {
    let clean = trace();
    let strain = |trace: &Trace| trace.reference.clone().unwrap().values;
    let jittered = with(Fault::Jitter { share: 0.3 }, 1);
    assert!(jittered.time_s.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(jittered.time_s[ROWS] != clean.time_s[ROWS] && jittered.readings == clean.readings);
    // Ten seconds last twenty, and later rows are ten seconds late.
    let fast = with(Fault::WrongRate { factor: 2.0 }, 1);
    let after = ROWS.end + 10;
    assert!((fast.time_s[after] - clean.time_s[after] - 9.95).abs() < 1e-9, "{}", fast.time_s[after]);
    let twice = with(Fault::Duplicated { share: 1.0 }, 1);
    assert_eq!(twice.len(), clean.len() + ROWS.len());
    assert_eq!(strain(&twice)[ROWS.start + 1], strain(&clean)[ROWS.start]);
    let late = with(Fault::Late { share: 1.0 }, 1);
    let (a, b) = (ROWS.start, ROWS.start + 1);
    assert_eq!((late.time_s[a], late.time_s[b]), (clean.time_s[b], clean.time_s[a]));
    assert_eq!(late.readings.values[a], clean.readings.values[b]);
    // The sensor has slipped: the body's strain is unchanged, the sensor's is not.
    let slipped = with(Fault::Slipped { by: 0.05 }, 1);
    assert_eq!(slipped.readings, clean.readings);
    assert!((strain(&slipped)[a] - strain(&clean)[a] - 0.05).abs() < 1e-15);
}
