//! Peak heap per sample of the smoothers, in lines of name and bytes; the readings themselves are not counted.

use nalgebra::SVector;
use ohmstrain_bench_comparison::{adskalman_smoother, typed_kalman_smoother};
use ohmstrain_bench_filters::{DT_S, linear_sensor, linearised, readings, sensor, smoother, sparse_smooth};
use ohmstrain_ekf::{Belief, Compact, LinearFilter, Reading, SparseEkf};
use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

const ROWS: usize = 100_000;

fn main() {
    let rows = readings::<1>(ROWS);
    let vectors: Vec<SVector<f64, 1>> = rows.iter().map(|y| SVector::from([*y])).collect();
    let ours = smoother(sensor::<1, 3>());
    peak("smoother_3", || ours.in_place(&rows));
    let model = sensor::<1, 3>();
    let ekf = SparseEkf::<_, Compact, 1, 3>::new(model, DT_S).expect("the step's length is positive");
    let taken: Vec<_> = rows.iter().map(|y| Some(Reading::from(*y))).collect();
    peak("sparse_smoother_3", || sparse_smooth(&ekf, &Belief::initial(&model), &taken));
    let (linear, filter) = (linear_sensor(), LinearFilter::new(linear_sensor(), DT_S).expect("the sensor is linear"));
    peak("linear_smoother_3", || sparse_smooth(&filter, &Belief::initial(&linear), &taken));
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
