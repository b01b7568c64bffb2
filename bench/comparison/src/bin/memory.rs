//! Peak heap per sample of the smoothers, bytes, without the readings; one line per smoother.

use nalgebra::SVector;
use ohmstrain_bench_comparison::{adskalman_smoother, typed_kalman_smoother};
use ohmstrain_bench_filters::{linearised, readings, sensor, smoother};
use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

const ROWS: usize = 100_000;

fn main() {
    let rows = readings::<1>(ROWS);
    let vectors: Vec<SVector<f64, 1>> = rows.iter().map(|y| SVector::from([*y])).collect();
    let ours = smoother(sensor::<1, 3>());
    peak("smoother_3", || ours.in_place(&rows));
    let theirs = adskalman_smoother(&linearised());
    peak("adskalman_smoother_3", || theirs(&vectors));
    let theirs = typed_kalman_smoother(&linearised());
    peak("typed_kalman_smoother_3", || theirs(&rows));
}

fn peak<T>(name: &str, work: impl FnOnce() -> T) {
    let before = HEAP.current_usage();
    HEAP.reset_peak_usage();
    drop(work());
    println!("{name} {:.0}", (HEAP.peak_usage() - before) as f64 / ROWS as f64);
}
