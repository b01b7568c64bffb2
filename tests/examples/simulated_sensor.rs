//! Makes `docs/simulated-sensor.md`: what the demo's sensors have in common with real ones.
//! `cargo run --release -p ohmstrain-tests --example simulated_sensor -- TRACE… > docs/simulated-sensor.md`

use std::error::Error;
use std::path::Path;

use comfy_table::{Table, presets};
use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
use ohmstrain_tests::character::{Character, Known};

const SEEDS: std::ops::RangeInclusive<u64> = 1..=5;

fn simulated(material: Material, seed: u64) -> Result<Trace, Box<dyn Error>> {
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        mismatched: true,
        seed,
        ..SimulationSettings::new(material, Protocol::MIXED)
    };
    Ok(simulate(&settings)?)
}

fn known(trace: &Trace) -> Known {
    let mut known = Known::default();
    for k in 0..trace.len() {
        let reading = trace.readings.values[k];
        if let Some(strain) = trace
            .reference
            .as_ref()
            .map(|reference| reference.values[k])
            .filter(|e| e.is_finite() && reading.is_finite())
        {
            known.time_s.push(trace.time_s[k]);
            known.reading.push(reading);
            known.strain.push(strain);
        }
    }
    known
}

fn row(table: &mut Table, name: &str, of: Character) {
    let cells = [of.static_cubic, of.loop_area, of.release_peak, of.drift].map(|x| format!("{x:.1}"));
    table.add_row([name.to_owned()].into_iter().chain(cells));
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["recording", "static cubic", "loop area", "release peak", "drift"]);
    for path in std::env::args().skip(1) {
        let name = Path::new(&path).file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        row(&mut table, &name, known(&Trace::read(std::fs::File::open(&path)?, &name)?).character());
    }
    for (name, material) in [("representative", Material::Representative), ("worst-case", Material::Ecoflex0030)] {
        for seed in SEEDS {
            row(
                &mut table,
                &format!("demo --material {name} --seed {seed}"),
                known(&simulated(material, seed)?).character(),
            );
        }
    }
    print!(include_str!("simulated_sensor.md"), table = table);
    Ok(())
}
