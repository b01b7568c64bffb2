//! Baselines against naive dense least squares: integrals are summed, designs stacked, and every block left out explicitly.

use nalgebra::{DMatrix, DVector};
use ohmstrain_calib::{Baseline, Baselines, Fir, LeakyBank, LowPassMode, PublishedLaw};
use ohmstrain_model::Phase;

use super::bench::Bench;

impl Bench {
    /// Returns the known times and readings up to a row.
    fn known(&self, row: usize) -> Vec<(f64, f64)> {
        (0..=row).filter(|&k| self.reading[k].is_finite()).map(|k| (self.time_s[k], self.reading[k])).collect()
    }

    fn complete(&self) -> Vec<usize> {
        (0..self.time_s.len()).filter(|&k| self.reading[k].is_finite() && self.strain[k].is_finite()).collect()
    }
}

/// Returns a recording of a sine with a harmonic, read through a parabola with memory; steps from `step_s` to twice that, with missing
/// readings and a missing reference.
fn record(rows: usize, step_s: f64, phase: f64) -> Bench {
    let mut bench = Bench::default();
    let (mut time_s, mut memory) = (3.0, 0.0);
    for k in 0..rows {
        let strain = 0.15 + 0.1 * (0.4 * time_s + phase).sin() + 0.04 * (1.1 * time_s).sin();
        let next = step_s * (1.0 + (k as f64 * 0.618_033_988_749_895).fract());
        memory += next / 6.0 * (strain - memory);
        bench.time_s.push(time_s);
        bench.reading.push(if k % 29 == 3 {
            f64::NAN
        } else {
            1000.0 * (1.0 + 1.5 * strain - strain * strain - 0.6 * memory)
        });
        bench.strain.push(if k % 31 == 5 { f64::NAN } else { strain });
        time_s += next;
    }
    bench
}

/// Scales readings to ±1 by the range of the complete rows.
fn scaled(benches: &[Bench], reading: f64) -> f64 {
    let known: Vec<f64> =
        benches.iter().flat_map(|bench| bench.complete().into_iter().map(|k| bench.reading[k])).collect();
    let (low, high) = (known.iter().copied().fold(f64::MAX, f64::min), known.iter().copied().fold(f64::MIN, f64::max));
    2.0 * (reading - low) / (high - low) - 1.0
}

/// Returns the convolution of straight lines between known readings with exp(-t/τ)/τ, each line by Simpson's rule.
fn low_pass(known: &[(f64, f64)], tau_s: f64) -> f64 {
    let (end_s, _) = known[known.len() - 1];
    let kernel = |t: f64| (-(end_s - t) / tau_s).exp() / tau_s;
    let mut value = known[0].1 * (-(end_s - known[0].0) / tau_s).exp();
    for pair in known.windows(2) {
        let ((a_s, a), (b_s, b)) = (pair[0], pair[1]);
        // Steps are at most 0.8 s, so h/τ is below 0.8/32/0.5 = 0.05 and Simpson's error below 0.05⁴/180 = 4e-8 of the line's contribution.
        let panels = 32;
        let h = (b_s - a_s) / f64::from(panels);
        for panel in 0..panels {
            let at = |share: f64| {
                let t = a_s + h * (f64::from(panel) + share);
                kernel(t) * (a + (t - a_s) / (b_s - a_s) * (b - a))
            };
            value += h / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0));
        }
    }
    value
}

/// Interpolates linearly; before the first reading it returns that reading.
fn interpolated(known: &[(f64, f64)], time_s: f64) -> f64 {
    let Some(pair) = known.windows(2).rev().find(|pair| pair[0].0 <= time_s) else { return known[0].1 };
    let ((a_s, a), (b_s, b)) = (pair[0], pair[1]);
    a + (time_s - a_s) / (b_s - a_s) * (b - a)
}

type FeaturesAt<'a> = &'a dyn Fn(&[(f64, f64)]) -> Vec<f64>;

/// Returns weights that minimise Σ(y - X w)² + ridge rows Σ var w² over all columns but the constant, as one stacked system.
fn ridge_weights(x: &DMatrix<f64>, y: &DVector<f64>, ridge: f64, variance: &[f64]) -> DVector<f64> {
    let (rows, size) = x.shape();
    let stacked = DMatrix::from_fn(rows + size, size, |k, j| match k.checked_sub(rows) {
        None => x[(k, j)],
        Some(i) if i == j && j > 0 => (ridge * rows as f64 * variance[j]).sqrt(),
        Some(_) => 0.0,
    });
    let right = DVector::from_fn(rows + size, |k, _| if k < rows { y[k] } else { 0.0 });
    stacked.svd(true, true).solve(&right, 1e-15).unwrap()
}

struct Naive {
    ridge: f64,
    cross_validated_rmse: f64,
    /// Strain in every row of every recording, clipped and held.
    strain: Vec<Vec<f64>>,
}

fn naive(benches: &[Bench], ridges: &[f64], features: FeaturesAt) -> Naive {
    let row_of = |bench: &Bench, k: usize| {
        let known: Vec<(f64, f64)> =
            bench.known(k).into_iter().map(|(time_s, reading)| (time_s, scaled(benches, reading))).collect();
        features(&known)
    };
    let (mut rows, mut strain, mut block) = (vec![], vec![], vec![]);
    for (b, bench) in benches.iter().enumerate() {
        let complete = bench.complete();
        for (i, &k) in complete.iter().enumerate() {
            rows.push(row_of(bench, k));
            strain.push(bench.strain[k]);
            // Quarters of each recording: block q begins at row ⌊q n/4⌋.
            block.push(4 * b + (0..4).rev().find(|q| q * complete.len() / 4 <= i).unwrap());
        }
    }
    let size = rows[0].len();
    let variance: Vec<f64> = (0..size)
        .map(|j| {
            let mean = rows.iter().map(|row| row[j]).sum::<f64>() / rows.len() as f64;
            rows.iter().map(|row| (row[j] - mean).powi(2)).sum::<f64>() / rows.len() as f64
        })
        .collect();
    let fit = |keep: &dyn Fn(usize) -> bool, ridge: f64| {
        let kept: Vec<usize> = (0..rows.len()).filter(|&k| keep(block[k])).collect();
        let x = DMatrix::from_fn(kept.len(), size, |k, j| rows[kept[k]][j]);
        ridge_weights(&x, &DVector::from_fn(kept.len(), |k, _| strain[kept[k]]), ridge, &variance)
    };
    let dot = |row: &[f64], weights: &DVector<f64>| row.iter().zip(weights.iter()).map(|(a, b)| a * b).sum::<f64>();
    let cross_validated = |ridge: f64| {
        let weights: Vec<_> = (0..4 * benches.len()).map(|left_out| fit(&|b| b != left_out, ridge)).collect();
        let squares = (0..rows.len()).map(|k| (strain[k] - dot(&rows[k], &weights[block[k]])).powi(2));
        (squares.sum::<f64>() / rows.len() as f64).sqrt()
    };
    let best = ridges.iter().map(|&ridge| (cross_validated(ridge), ridge)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (cross_validated_rmse, ridge) = best.unwrap();
    let weights = fit(&|_| true, ridge);
    let (lower, upper) =
        (strain.iter().copied().fold(f64::MAX, f64::min), strain.iter().copied().fold(f64::MIN, f64::max));
    let run = |bench: &Bench| {
        let mut last = 0.5 * (lower + upper);
        let mut next = |k: usize| {
            if bench.reading[k].is_finite() {
                last = dot(&row_of(bench, k), &weights).clamp(lower, upper);
            }
            last
        };
        (0..bench.time_s.len()).map(&mut next).collect()
    };
    Naive { ridge, cross_validated_rmse, strain: benches.iter().map(run).collect() }
}

fn run(mut baseline: impl Baseline, bench: &Bench) -> Vec<f64> {
    bench.time_s.iter().zip(&bench.reading).map(|(&time_s, &reading)| baseline.strain(time_s, reading)).collect()
}

#[track_caller]
fn assert_close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        assert!((a - b).abs() <= tolerance, "row {k}: {a} and {b}");
    }
}

const BASELINE_RIDGES: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Error of Simpson's rule in a feature, 4e-8, times weights of at most 1 on twenty features.
const TOLERANCE: f64 = 1e-6;

#[test]
fn the_leaky_bank_is_ridge_regression_on_products_of_convolutions() {
    let benches = [record(300, 0.2, 0.0), record(200, 0.3, 1.0)];
    let features = |known: &[(f64, f64)]| {
        let reading = known[known.len() - 1].1;
        let mut linear = vec![reading];
        linear.extend([0.5, 2.0, 8.0, 32.0].map(|tau_s| reading - low_pass(known, tau_s)));
        let mut row = vec![1.0];
        row.extend(&linear);
        for i in 0..5 {
            row.extend((i..5).map(|j| linear[i] * linear[j]));
        }
        row
    };
    let naive = naive(&benches, &BASELINE_RIDGES, &features);
    let fitted = LeakyBank::fit(&[benches[0].samples(), benches[1].samples()]).unwrap();
    assert_eq!(fitted.ridge, naive.ridge);
    assert!((fitted.cross_validated_rmse - naive.cross_validated_rmse).abs() < TOLERANCE);
    for (bench, strain) in benches.iter().zip(&naive.strain) {
        assert_close(&run(fitted.start(), bench), strain, TOLERANCE);
    }
}

#[test]
fn the_fir_is_ridge_regression_on_interpolated_readings() {
    let benches = [record(300, 0.2, 0.0), record(200, 0.4, 1.0)];
    let fitted = Fir::fit(&[benches[0].samples(), benches[1].samples()]).unwrap();
    // The second recording's steps are 0.4 to 0.8 s, with a median near 0.6 s; 20 s are 33 of them.
    assert!((0.5..0.7).contains(&fitted.features.spacing_s()));
    assert_eq!(fitted.features.taps(), (20.0 / fitted.features.spacing_s()) as usize);
    let features = |known: &[(f64, f64)]| {
        let end_s = known[known.len() - 1].0;
        let lag_s = |tap: usize| tap as f64 * fitted.features.spacing_s();
        let taps = (0..fitted.features.taps()).map(|tap| interpolated(known, end_s - lag_s(tap)));
        std::iter::once(1.0).chain(taps).collect()
    };
    let naive = naive(&benches, &BASELINE_RIDGES, &features);
    assert_eq!(fitted.ridge, naive.ridge);
    // Normal equations square the condition number: with the least ridge 1e-6 they lose 2⁻⁵² · 1e6 · 33 = 7e-9.
    assert!((fitted.cross_validated_rmse - naive.cross_validated_rmse).abs() < 1e-8);
    for (bench, strain) in benches.iter().zip(&naive.strain) {
        assert_close(&run(fitted.start(), bench), strain, 1e-8);
    }
}

#[test]
fn the_low_pass_mode_is_least_squares_at_its_time_constant() {
    let benches = [record(300, 0.2, 0.0)];
    let fitted = LowPassMode::fit(&[benches[0].samples()]).unwrap();
    let features = |tau_s: f64| {
        move |known: &[(f64, f64)]| {
            let z = known[known.len() - 1].1;
            vec![1.0, z, z * z, z * z * z, z - low_pass(known, tau_s)]
        }
    };
    // 24 time constants, evenly spaced in their logarithm, from three rows to a quarter of the recording.
    let time_s = &benches[0].time_s;
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let (shortest_s, longest_s) = (3.0 * steps[steps.len() / 2], 0.25 * (time_s[time_s.len() - 1] - time_s[0]));
    let grid = (0..24).map(|i| (shortest_s.ln() + f64::from(i) / 23.0 * (longest_s / shortest_s).ln()).exp());
    let tried = grid.map(|tau_s| (tau_s, naive(&benches, &[0.0], &features(tau_s))));
    let best = tried.min_by(|a, b| a.1.cross_validated_rmse.total_cmp(&b.1.cross_validated_rmse));
    let (tau_s, best) = best.unwrap();
    assert!((fitted.features.tau_s() / tau_s - 1.0).abs() < 1e-12, "{} and {tau_s}", fitted.features.tau_s());
    assert!((fitted.cross_validated_rmse - best.cross_validated_rmse).abs() < TOLERANCE);
    assert_close(&run(fitted.start(), &benches[0]), &best.strain[0], TOLERANCE);
}

#[test]
fn rows_on_a_line_between_rows_change_nothing() {
    let bench = record(300, 0.2, 0.0);
    let baselines = Baselines::fit(&[bench.samples()]).unwrap();
    let known = bench.known(299);
    let mut between = Bench::default();
    for pair in known.windows(2) {
        let ((a_s, a), (b_s, b)) = (pair[0], pair[1]);
        for share in [0.0, 0.1, 0.7] {
            between.time_s.push(a_s + share * (b_s - a_s));
            between.reading.push(a + share * (b - a));
        }
    }
    let plain = Bench {
        time_s: known.iter().map(|row| row.0).collect(),
        reading: known.iter().map(|row| row.1).collect(),
        strain: vec![],
    };
    let check = |plain: Vec<f64>, between: Vec<f64>| {
        // The last known row is not followed by a line. A few hundred roundings of numbers of order one.
        let same: Vec<f64> = between.into_iter().step_by(3).collect();
        assert_close(&plain[..same.len()], &same, 1e-12);
    };
    check(run(baselines.fir.start(), &plain), run(baselines.fir.start(), &between));
    check(run(baselines.low_pass_mode.start(), &plain), run(baselines.low_pass_mode.start(), &between));
    check(run(baselines.leaky_bank.start(), &plain), run(baselines.leaky_bank.start(), &between));
}

#[test]
fn what_a_baseline_says_is_held_and_clipped() {
    let bench = record(300, 0.2, 0.0);
    let baselines = Baselines::fit(&[bench.samples()]).unwrap();
    let known = |values: &[f64]| values.iter().copied().filter(|x| x.is_finite()).collect::<Vec<f64>>();
    let strain = known(&bench.strain);
    let (lower, upper) =
        (strain.iter().copied().fold(f64::MAX, f64::min), strain.iter().copied().fold(f64::MIN, f64::max));
    let check = |mut baseline: Box<dyn Baseline>| {
        assert_eq!(baseline.strain(0.0, f64::NAN), 0.5 * (lower + upper));
        let first = baseline.strain(1.0, known(&bench.reading)[0]);
        assert_eq!(baseline.strain(2.0, f64::NAN), first);
        for reading in [-1e6, 1e6] {
            assert!((lower..=upper).contains(&baseline.strain(3.0, reading)));
        }
    };
    check(Box::new(ohmstrain_calib::running_cubic(baselines.static_cubic)));
    check(Box::new(baselines.fir.start()));
    check(Box::new(baselines.low_pass_mode.start()));
    check(Box::new(baselines.leaky_bank.start()));
}

#[test]
fn a_slow_recording_gets_a_coarse_grid_and_a_fast_one_forty_taps() {
    // Steps of 3 to 6 s, with a median of 4.5 s: four of them within 20 s.
    let slow = Fir::fit(&[record(200, 3.0, 0.0).samples()]).unwrap();
    assert_eq!(slow.features.taps(), 4);
    let fast = Fir::fit(&[record(1000, 0.05, 0.0).samples()]).unwrap();
    assert_eq!((fast.features.taps(), fast.features.spacing_s()), (40, 0.5));
}

#[test]
fn readings_that_do_not_vary_are_an_error() {
    let mut bench = record(100, 0.2, 0.0);
    bench.reading.fill(1000.0);
    assert!(Baselines::fit(&[bench.samples()]).is_err());
}

/// Ramps at several speeds with holds in between, by equations 8 and 9 as printed. The law that is fitted to them, given the starts of
/// phases, returns the strains.
#[test]
fn the_published_law_says_the_strain_of_its_own_readings() {
    // Stretches of 4 s and less, releases of 3 s; time constants on the grid of the fit.
    let dt_s = 0.25;
    let tau_s = |longest_s: f64, place: i32| longest_s * 0.01 * 3000_f64.powf(f64::from(place) / 79.0);
    let ramps = [(0.05, 4.0), (-0.04, 3.0), (0.02, 2.0), (-0.1, 1.0), (0.08, 1.5), (-0.05, 2.0)];
    let law = |speed: f64| if speed > 0.0 { (900.0, 150.0, tau_s(4.0, 60)) } else { (400.0, -80.0, tau_s(3.0, 50)) };
    let mut bench = Bench { time_s: vec![0.0], reading: vec![1000.0], strain: vec![0.1] };
    let mut phases = Vec::new();
    for (speed, duration_s) in ramps {
        let (start_s, strain, latched) =
            (bench.time_s.len(), bench.strain[bench.strain.len() - 1], bench.reading[bench.reading.len() - 1]);
        let (stiffness, viscosity, tau_s) = law(speed);
        for k in 1..=(duration_s / dt_s) as usize {
            let (elapsed_s, travel) = (k as f64 * dt_s, speed * k as f64 * dt_s);
            let moving: f64 = latched + stiffness * (-elapsed_s / tau_s).exp() * travel + viscosity * speed;
            bench.time_s.push(bench.time_s[bench.time_s.len() - 1] + dt_s);
            bench.reading.push(moving);
            bench.strain.push(strain + travel);
        }
        phases.push((if speed > 0.0 { Phase::Extend } else { Phase::Retract }, start_s..bench.time_s.len()));
        let (start_s, strain, latched) =
            (bench.time_s.len(), bench.strain[bench.strain.len() - 1], bench.reading[bench.reading.len() - 1]);
        for k in 1..=8 {
            bench.time_s.push(bench.time_s[bench.time_s.len() - 1] + dt_s);
            bench.reading.push(latched * (0.9 + 0.1 * (-f64::from(k) * dt_s / 3.0).exp()));
            bench.strain.push(strain);
        }
        phases.push((Phase::Hold, start_s..bench.time_s.len()));
    }
    let fitted = PublishedLaw::fit(&[bench.samples()], std::slice::from_ref(&phases)).unwrap();
    let starts = phases.iter().map(|(phase, rows)| (bench.time_s[rows.start], *phase)).collect();
    // Differences of one between readings of 10³, accumulated six times.
    assert_close(&run(fitted.start(starts, bench.strain[0]), &bench), &bench.strain, 1e-10);
    assert!(PublishedLaw::fit(&[bench.samples()], &[phases[..2].to_vec()]).is_err(), "there is no release");
}
