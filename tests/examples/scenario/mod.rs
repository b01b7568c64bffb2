use std::error::Error;

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};

/// The session that calibrates; the tests are other sessions with the same sensor.
pub const CALIBRATION_SEED: u64 = 0;
/// The sessions that test.
pub const TEST_SEEDS: std::ops::RangeInclusive<u64> = 1..=20;

/// Six holds of 300 s at random strains and speeds; 10 mm on 30 mm, up to 5 mm/s, 5 readings per second.
pub fn session(seed: u64) -> Result<Trace, Box<dyn Error>> {
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        sample_rate_hz: 5.0,
        mismatched: true,
        seed,
        ..SimulationSettings::new(Material::Ecoflex0030, Protocol::LONG_HOLDS)
    };
    Ok(simulate(&settings)?)
}
