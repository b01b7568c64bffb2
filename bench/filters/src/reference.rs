use crate::{Filter, LinearModel};

/// What a Kalman filter of three states costs at least: written out by hand, packed covariance, the zeros of F left out
/// and the one in H not multiplied, no check of anything, no likelihood.
///
/// The state is strain, rate and one branch: motion does not depend on the branch, and the reading contains it with
/// factor one.
#[derive(Clone, Copy, Debug)]
pub struct PackedReference {
    /// Rows of F: strain and rate from strain and rate; the branch from all three.
    strain: [f64; 2],
    rate: [f64; 2],
    branch: [f64; 3],
    /// Q as P below.
    noise: [f64; 6],
    /// H without its last entry.
    gradient: [f64; 2],
    variance: f64,
    mean: [f64; 3],
    /// Lower triangle of P, row by row.
    covariance: [f64; 6],
}

impl PackedReference {
    /// The filter of `model`.
    ///
    /// # Panics
    /// If the model does not have the zeros and the one that are left out here.
    #[must_use]
    pub fn new(model: &LinearModel) -> Self {
        let (f, q, h) = (&model.transition, &model.noise, &model.gradient);
        assert!(f[0][2] == 0.0 && f[1][2] == 0.0 && h[2] == 1.0, "not a model of this structure");
        let [p0, p1, p2] = model.start;
        Self {
            strain: [f[0][0], f[0][1]],
            rate: [f[1][0], f[1][1]],
            branch: f[2],
            noise: [q[0][0], q[1][0], q[1][1], q[2][0], q[2][1], q[2][2]],
            gradient: [h[0], h[1]],
            variance: model.variance,
            mean: [0.0; 3],
            covariance: [p0, 0.0, p1, 0.0, 0.0, p2],
        }
    }
}

impl Filter for PackedReference {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let ([a0, a1], [b0, b1], [c0, c1, c2]) = (self.strain, self.rate, self.branch);
        let ([x0, x1, x2], [p00, p10, p11, p20, p21, p22], q) = (self.mean, self.covariance, &self.noise);

        let m0 = a0 * x0 + a1 * x1;
        let m1 = b0 * x0 + b1 * x1;
        let m2 = c0 * x0 + c1 * x1 + c2 * x2;
        let (fa0, fa1) = (a0 * p00 + a1 * p10, a0 * p10 + a1 * p11);
        let (fb0, fb1) = (b0 * p00 + b1 * p10, b0 * p10 + b1 * p11);
        let fc0 = c0 * p00 + c1 * p10 + c2 * p20;
        let fc1 = c0 * p10 + c1 * p11 + c2 * p21;
        let fc2 = c0 * p20 + c1 * p21 + c2 * p22;
        let p00 = fa0 * a0 + fa1 * a1 + q[0];
        let p10 = fb0 * a0 + fb1 * a1 + q[1];
        let p11 = fb0 * b0 + fb1 * b1 + q[2];
        let p20 = fc0 * a0 + fc1 * a1 + q[3];
        let p21 = fc0 * b0 + fc1 * b1 + q[4];
        let p22 = fc0 * c0 + fc1 * c1 + fc2 * c2 + q[5];

        let [h0, h1] = self.gradient;
        let s0 = p00 * h0 + p10 * h1 + p20;
        let s1 = p10 * h0 + p11 * h1 + p21;
        let s2 = p20 * h0 + p21 * h1 + p22;
        let per_variance = 1.0 / (h0 * s0 + h1 * s1 + s2 + self.variance);
        let innovation = reading - (h0 * m0 + h1 * m1 + m2);
        let (k0, k1, k2) = (s0 * per_variance, s1 * per_variance, s2 * per_variance);
        self.mean = [m0 + k0 * innovation, m1 + k1 * innovation, m2 + k2 * innovation];
        self.covariance = [p00 - k0 * s0, p10 - k1 * s0, p11 - k1 * s1, p20 - k2 * s0, p21 - k2 * s1, p22 - k2 * s2];
        true
    }

    fn strain(&self) -> f64 {
        self.mean[0]
    }
}
