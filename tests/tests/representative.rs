//! The demo's sensor is as imperfect as real ones, and no worse.

use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
use ohmstrain_tests::character::{Character, Known};

fn character(material: Material, seed: u64) -> Character {
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        mismatched: true,
        seed,
        ..SimulationSettings::new(material, Protocol::MIXED)
    };
    let trace = simulate(&settings).unwrap();
    Known { time_s: trace.time_s, reading: trace.readings.values, strain: trace.reference.unwrap().values }.character()
}

/// Smallest and largest values of eight public recordings, percent (richgumy/electromech-stretcher, 7.5 wt-% carbon black:
/// slow sine, short ramps, triangles, six-sine, sawtooth, four speeds; vistormu/catasta, coated nylon: sine, triangle),
/// from `docs/simulated-sensor.md`.
const REAL: [(&str, f64, f64); 4] =
    [("static cubic", 6.0, 14.3), ("loop area", 7.3, 34.8), ("release peak", 0.0, 34.8), ("drift", 0.4, 4.9)];

#[test]
fn the_representative_sensor_is_within_what_real_ones_show() {
    for seed in 1..=5 {
        let of = character(Material::Representative, seed);
        for ((name, least, most), found) in
            REAL.into_iter().zip([of.static_cubic, of.loop_area, of.release_peak, of.drift])
        {
            assert!(least <= found && found <= most, "seed {seed}, {name}: {found} in {least} to {most}");
        }
    }
}

#[test]
fn the_worst_case_is_beyond_them() {
    let of = character(Material::Ecoflex0030, 1);
    assert!(of.static_cubic > 2.0 * REAL[0].2 && of.drift > 4.0 * REAL[3].2, "{of:?}");
}
