//! Ten million steps in f32: a day of a sensor read at a hundred hertz, and more.

use ohmstrain_ekf::{Belief, Dynamics, Ekf, Reading};
use ohmstrain_tests::sensor;

const STEPS: u32 = 10_000_000;
const DT_S: f32 = 0.01;

/// The smallest eigenvalue of the correlation matrix: what is left where everything known is taken out.
fn smallest_correlation_eigenvalue(belief: &Belief<f32, 5, 15>) -> f64 {
    let p = belief.covariance.to_matrix().map(f64::from);
    let scaled = nalgebra::SMatrix::<f64, 5, 5>::from_fn(|i, j| p[(i, j)] / (p[(i, i)] * p[(j, j)]).sqrt());
    scaled.symmetric_eigenvalues().min()
}

#[test]
fn ten_million_steps_keep_the_covariance_positive_semi_definite() {
    let model = sensor::<f32, 2, 5>();
    let ekf = Ekf::new(model);
    let prepared = Dynamics::<f32, 5, 15>::prepare(&model, DT_S);
    let mut belief: Belief<f32, 5, 15> = Belief::initial(&model);
    let mut noise = 1_u32;
    for k in 0..STEPS {
        // A slow movement with holds, every seventh reading missing, and a little noise.
        let phase = f64::from(k % 6000) / 6000.0;
        let strain = 0.3 * (2.0 * phase - 0.5).clamp(0.0, 1.0) as f32;
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let jitter = (f64::from(noise) / f64::from(u32::MAX) - 0.5) as f32 * 5e-3;
        let reading = (k % 7 != 0).then(|| Reading::from(1.6 * strain - 1.2 * strain * strain + jitter));
        belief = ekf.step_prepared(&belief, &prepared, reading).unwrap().posterior;
        if k % 1000 == 0 {
            // Rounding of the entries alone moves an eigenvalue by up to 5 · 6e-8.
            let smallest = smallest_correlation_eigenvalue(&belief);
            assert!(smallest > -3e-7, "step {k}: {smallest}");
        }
    }
    assert!(belief.is_finite());
}
