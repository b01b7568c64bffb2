//! A recording on stdin, `time_s,resistance_ohm,…`, through the exported Rust module that is named: `time_s,strain,strain_sd,flags`,
//! flags as exported C has them. `modules.rs` lists what there is.
use std::error::Error;
use std::io;

use ohmstrain_ekf::live::{Learned, LiveFilter, SensorEstimator};

/// In the order of `ohmstrain_flag`.
const FLAGS: [&str; 10] = [
    "missing",
    "implausible",
    "stuck",
    "rejected",
    "downweighted",
    "start_up",
    "recovering",
    "extrapolated",
    "long_run",
    "rest_moved",
];

include!("modules.rs");

fn replay<E: SensorEstimator<f32, N, L>, const N: usize, const L: usize>(
    mut filter: LiveFilter<f32, E, Learned<'static, f32>, N, L>,
    dt_s: f32,
) -> Result<(), Box<dyn Error>> {
    println!("time_s,strain,strain_sd,flags");
    let mut last_s: Option<f64> = None;
    for line in io::stdin().lines() {
        let line = line?;
        let mut cells = line.split(',');
        // Metadata and the header.
        let Some(Ok(time_s)) = cells.next().map(str::parse::<f64>) else { continue };
        let reading = cells.next().and_then(|cell| cell.parse().ok()).map(|ohm| filter.relative(ohm, 0.0));
        let now = filter.step_after(last_s.map_or(dt_s, |last_s| (time_s - last_s) as f32), reading)?;
        last_s = Some(time_s);
        let bits: u32 = (0..)
            .zip(FLAGS)
            .filter(|(_, name)| now.flags.names().any(|flag| flag == *name))
            .map(|(bit, _)| 1 << bit)
            .sum();
        println!("{time_s},{},{},{bits}", now.strain.mean, now.strain.sd());
    }
    Ok(())
}
