//! A short motion, and its readings by a sensor's law.

use ohmstrain_model::{Phase, SensorLaw};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Corners of the strain's path: number of steps so far, and strain as a share of the range. Rest, stretch, hold, release, hold, half-way.
const CORNERS: [(usize, f64); 7] =
    [(0, 0.02), (20, 0.02), (100, 0.95), (150, 0.95), (230, 0.05), (260, 0.05), (300, 0.5)];

/// Rows without a reading: one alone, and a gap.
const MISSING: [std::ops::Range<usize>; 2] = [60..61, 170..175];
/// Rows whose reading has additional noise.
const NOISY: std::ops::Range<usize> = 120..130;

/// One row.
pub struct MotionRow {
    /// R/R₀ - 1; `None` if it is missing.
    pub rho: Option<f64>,
    /// Standard deviation of the reading's additional noise, relative to R₀.
    pub extra_sd: f64,
}

/// Returns the rows of the motion, with white noise of `reading_sd` from a seed.
pub fn rows<const B: usize>(law: &SensorLaw<f64, B>, dt_s: f64, reading_sd: f64, seed: u64) -> Vec<MotionRow> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut relaxation = [0.0; B];
    let mut rows = Vec::new();
    for corners in CORNERS.windows(2) {
        let ((start, from), (end, to)) = (corners[0], corners[1]);
        let steps = end - start;
        let per_step = (to - from) / steps as f64 * law.range.span();
        for step in 1..=steps {
            let strain = law.range.lower + from * law.range.span() + per_step * step as f64;
            let rate = per_step / dt_s;
            let phase = match rate {
                rate if rate > 0.0 => Phase::Extend,
                rate if rate < 0.0 => Phase::Retract,
                _ => Phase::Hold,
            };
            for i in 0..B {
                let tau_s = law.branches[i].tau_s;
                let (gain, _) = law.gain(i, strain - 0.5 * per_step, phase);
                relaxation[i] += -(-dt_s / tau_s).exp_m1() * (gain * rate * tau_s - relaxation[i]);
            }
            let row = rows.len();
            let extra_sd = if NOISY.contains(&row) { 2.0 * reading_sd } else { 0.0 };
            let noise: f64 = StandardNormal.sample(&mut random);
            let rho = law.relative_change(strain, rate, &relaxation, 0.0, phase) + (reading_sd + extra_sd) * noise;
            // Noise can be large enough to make a resistance negative.
            let rho = (!MISSING.iter().any(|gap| gap.contains(&row))).then_some(rho.max(-0.99));
            rows.push(MotionRow { rho, extra_sd });
        }
    }
    rows
}
