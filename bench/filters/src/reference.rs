use ohmstrain_ekf::Belief;

use crate::nonlinear::NonlinearModel;
use crate::{Filter, LinearModel, sensor};

/// Mean, and lower triangle of P row by row, of strain, rate and one branch. Motion does not depend on the branch, and a
/// reading contains the branch with factor one. It represents the minimal cost of a Kalman filter: written by hand, without the
/// zeros of F and the one in H, without checks, without a likelihood.
#[derive(Clone, Copy, Debug)]
struct Packed {
    mean: [f64; 3],
    covariance: [f64; 6],
}

impl Packed {
    /// Predicts by rows of F, and Q packed like P.
    #[inline(always)]
    fn ahead(&self, mean: [f64; 3], [[a0, a1], [b0, b1]]: [[f64; 2]; 2], [c0, c1, c2]: [f64; 3], q: [f64; 6]) -> Self {
        let [p00, p10, p11, p20, p21, p22] = self.covariance;
        let (fa0, fa1) = (a0 * p00 + a1 * p10, a0 * p10 + a1 * p11);
        let (fb0, fb1) = (b0 * p00 + b1 * p10, b0 * p10 + b1 * p11);
        let fc0 = c0 * p00 + c1 * p10 + c2 * p20;
        let fc1 = c0 * p10 + c1 * p11 + c2 * p21;
        let fc2 = c0 * p20 + c1 * p21 + c2 * p22;
        let covariance = [
            fa0 * a0 + fa1 * a1 + q[0],
            fb0 * a0 + fb1 * a1 + q[1],
            fb0 * b0 + fb1 * b1 + q[2],
            fc0 * a0 + fc1 * a1 + q[3],
            fc0 * b0 + fc1 * b1 + q[4],
            fc0 * c0 + fc1 * c1 + fc2 * c2 + q[5],
        ];
        Self { mean, covariance }
    }

    /// Updates with an innovation and the variance of the reading; H is given without its last entry.
    #[inline(always)]
    fn take(&self, [h0, h1]: [f64; 2], innovation: f64, variance: f64) -> Self {
        let ([m0, m1, m2], [p00, p10, p11, p20, p21, p22]) = (self.mean, self.covariance);
        let s0 = p00 * h0 + p10 * h1 + p20;
        let s1 = p10 * h0 + p11 * h1 + p21;
        let s2 = p20 * h0 + p21 * h1 + p22;
        let per_variance = 1.0 / (h0 * s0 + h1 * s1 + s2 + variance);
        let (k0, k1, k2) = (s0 * per_variance, s1 * per_variance, s2 * per_variance);
        Self {
            mean: [m0 + k0 * innovation, m1 + k1 * innovation, m2 + k2 * innovation],
            covariance: [p00 - k0 * s0, p10 - k1 * s0, p11 - k1 * s1, p20 - k2 * s0, p21 - k2 * s1, p22 - k2 * s2],
        }
    }
}

/// The linear filter.
#[derive(Clone, Copy, Debug)]
pub struct PackedReference {
    /// Rows of F: strain and rate from strain and rate; the branch from all three.
    motion: [[f64; 2]; 2],
    branch: [f64; 3],
    /// Q packed like P.
    noise: [f64; 6],
    /// H without its last entry.
    gradient: [f64; 2],
    variance: f64,
    state: Packed,
}

impl PackedReference {
    /// Creates the filter of `model`.
    ///
    /// # Panics
    /// If the model lacks the zeros, or the one, that are left out here.
    #[must_use]
    pub fn new(model: &LinearModel) -> Self {
        let (f, q, h) = (&model.transition, &model.noise, &model.gradient);
        assert!(f[0][2] == 0.0 && f[1][2] == 0.0 && h[2] == 1.0, "not a model of this structure");
        let [p0, p1, p2] = model.start;
        Self {
            motion: [[f[0][0], f[0][1]], [f[1][0], f[1][1]]],
            branch: f[2],
            noise: [q[0][0], q[1][0], q[1][1], q[2][0], q[2][1], q[2][2]],
            gradient: [h[0], h[1]],
            variance: model.variance,
            state: Packed { mean: [0.0; 3], covariance: [p0, 0.0, p1, 0.0, 0.0, p2] },
        }
    }
}

impl Filter for PackedReference {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let ([[a0, a1], [b0, b1]], [c0, c1, c2], [x0, x1, x2]) = (self.motion, self.branch, self.state.mean);
        let mean = [a0 * x0 + a1 * x1, b0 * x0 + b1 * x1, c0 * x0 + c1 * x1 + c2 * x2];
        let [h0, h1] = self.gradient;
        let innovation = reading - (h0 * mean[0] + h1 * mean[1] + mean[2]);
        let predicted = self.state.ahead(mean, self.motion, self.branch, self.noise);
        self.state = predicted.take(self.gradient, innovation, self.variance);
        true
    }

    fn strain(&self) -> f64 {
        self.state.mean[0]
    }
}

/// The filter of [`sensor`], which computes F, Q and H in every step.
#[derive(Clone, Copy, Debug)]
pub struct NonlinearReference {
    model: NonlinearModel,
    state: Packed,
}

impl NonlinearReference {
    /// Starts from the long-run distribution.
    #[must_use]
    pub fn new() -> Self {
        let start = Belief::<f64, 3, 6>::initial(&sensor::<1, 3>());
        let state = Packed { mean: start.mean.into(), covariance: *start.covariance.packed() };
        Self { model: NonlinearModel::new(), state }
    }
}

impl Default for NonlinearReference {
    fn default() -> Self {
        Self::new()
    }
}

impl Filter for NonlinearReference {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let [p00, p10, p11, ..] = self.state.covariance;
        let ahead = self.model.ahead(self.state.mean, [p00, p10, p11]);
        let ([[a0, a1, _], [b0, b1, _], branch], [[q00, ..], [q10, q11, _], [q20, q21, q22]]) =
            (ahead.transition, ahead.noise);
        let expected = self.model.expected(ahead.mean, ahead.rate_variance);
        let noise = [q00, q10, q11, q20, q21, q22];
        let predicted = self.state.ahead(ahead.mean, [[a0, a1], [b0, b1]], branch, noise);
        let [h0, h1, _] = expected.gradient;
        self.state = predicted.take([h0, h1], reading - expected.value, expected.variance);
        true
    }

    fn strain(&self) -> f64 {
        self.state.mean[0]
    }
}
