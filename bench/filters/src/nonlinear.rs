use ohmstrain_model::{Gauge, SensorLaw, correlated_steps, unexplained};

use crate::{DT_S, sensor};

/// The step of [`sensor`] as the user of a filter of matrices writes it: F, Q and H are computed in every step, from the strain
/// and an uncertain direction. Its numbers are those of [`Compact`](ohmstrain_ekf::Compact).
#[derive(Clone, Copy, Debug)]
pub struct NonlinearModel {
    law: SensorLaw<f64, 1>,
    /// Coefficients of the cubic gauge.
    coefficients: [f64; 3],
    reading_variance: f64,
    motion: [[f64; 2]; 2],
    motion_change: [f64; 2],
    input: [f64; 2],
    /// Variances of strain and rate, and their covariance between them.
    noise: [f64; 3],
    averaging: f64,
    decay: f64,
    reach: f64,
    drive: [f64; 2],
    drive_input: f64,
    cross_noise: [f64; 2],
    /// Noise of the branch caused by the motion, and its own noise.
    branch_noise: [f64; 2],
}

/// Prediction and its Jacobian.
#[derive(Clone, Copy, Debug)]
pub struct Ahead {
    /// Mean of the state.
    pub mean: [f64; 3],
    /// F, row by row.
    pub transition: [[f64; 3]; 3],
    /// Q.
    pub noise: [[f64; 3]; 3],
    /// Variance of the predicted rate.
    pub rate_variance: f64,
}

/// A predicted reading.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Its mean.
    pub value: f64,
    /// H.
    pub gradient: [f64; 3],
    /// R.
    pub variance: f64,
}

impl NonlinearModel {
    /// Creates the model for steps of [`DT_S`].
    ///
    /// # Panics
    /// Never: the sensor's gauge is cubic.
    #[must_use]
    pub fn new() -> Self {
        let model = sensor::<1, 3>();
        let (step, motion) = (model.prepare(DT_S), model.motion());
        let (response, push) = (step.response(), motion.restoring()[0] * motion.rest_strain());
        let [[a0, a1], [b0, b1]] = response.motion_change;
        let [[strain, _], [both, rate]] = response.motion_noise;
        let Gauge::Polynomial { coefficients } = model.law().gauge else { unreachable!("the sensor's gauge is cubic") };
        Self {
            law: *model.law(),
            coefficients,
            reading_variance: model.noise().reading_sd * model.noise().reading_sd,
            motion: [[1.0 + a0, a1], [b0, 1.0 + b1]],
            motion_change: [b0, b1],
            input: response.input.map(|answer| answer * push),
            noise: [strain, both, rate],
            averaging: step.averaging(),
            decay: 1.0 + response.decay_change[0],
            reach: -response.decay_change[0] * model.law().branches[0].tau_s,
            drive: response.drive[0],
            drive_input: response.drive_input[0] * push,
            cross_noise: response.cross_noise[0],
            branch_noise: [response.branch_noise[0][0], step.branch_variance()[0]],
        }
    }

    /// Predicts one step from a mean and the covariances of strain and rate.
    #[inline(always)]
    #[must_use]
    pub fn ahead(&self, [x0, x1, x2]: [f64; 3], [p00, p10, p11]: [f64; 3]) -> Ahead {
        let ([[a0, a1], [b0, b1]], [n00, n10, n11]) = (self.motion, self.noise);
        let (m0, m1) = (self.input[0] + a0 * x0 + a1 * x1, self.input[1] + b0 * x0 + b1 * x1);
        let [with_strain, together] = [b0 * p00 + b1 * p10, b0 * p10 + b1 * p11];
        let rate_variance = n11 + b0 * with_strain + b1 * together;
        let branch = &self.law.branches[0];
        let middle = 0.5 * (x0 + m0);
        let inside = middle.max(self.law.range.lower).min(self.law.range.upper);
        // Half of the growth comes from the old strain, half from the new one.
        let growth = if inside == middle { 0.5 } else { 0.0 };
        let (extend, retract) = (
            branch.extend_gain + branch.extend_gain_slope * inside,
            branch.retract_gain + branch.retract_gain_slope * inside,
        );
        let rate = (self.drive_input + self.drive[0] * x0 + self.drive[1] * x1) / self.reach;
        let split = Split::of(rate, 0.5 * (p11 + rate_variance));
        let change = self.reach * (extend * split.extend + retract * split.retract);
        let gain = extend * split.extends + retract * split.retracts;
        let growing = branch.extend_gain_slope * split.extend + branch.retract_gain_slope * split.retract;
        let pull = self.reach * growth * growing;
        let jump = self.reach * (extend - retract);
        let mut left = 0.0;
        if split.variance > 0.0 {
            let fresh = n11 + self.motion_change[0] * with_strain + self.motion_change[1] * together;
            left = split.variance * self.averaging * correlated_steps(rate_variance, together, fresh);
        }
        let q20 = gain * self.cross_noise[0] + pull * n00;
        let q21 = gain * self.cross_noise[1] + pull * n10;
        let own = gain * self.branch_noise[0] + pull * self.cross_noise[0];
        let q22 = self.branch_noise[1] + pull * q20 + gain * own + left * jump * jump;
        let [d0, d1] = [gain * self.drive[0] + pull * (1.0 + a0), gain * self.drive[1] + pull * a1];
        Ahead {
            mean: [m0, m1, change + self.decay * x2],
            transition: [[a0, a1, 0.0], [b0, b1, 0.0], [d0, d1, self.decay]],
            noise: [[n00, n10, q20], [n10, n11, q21], [q20, q21, q22]],
            rate_variance,
        }
    }

    /// Returns the expected reading.
    #[inline(always)]
    #[must_use]
    pub fn expected(&self, [strain, rate, branch]: [f64; 3], rate_variance: f64) -> Expected {
        let (law, [a1, a2, a3]) = (&self.law, self.coefficients);
        let inside = strain.max(law.range.lower).min(law.range.upper);
        let slope = a1 + inside * (2.0 * a2 + inside * 3.0 * a3);
        let gauge = inside * (a1 + inside * (a2 + inside * a3)) + slope * (strain - inside);
        let split = Split::of(rate, rate_variance);
        let (extend, retract) = (law.extend_viscosity_s, law.retract_viscosity_s);
        let jump = extend - retract;
        Expected {
            value: gauge + extend * split.extend + retract * split.retract + branch,
            gradient: [slope, extend * split.extends + retract * split.retracts, 1.0],
            variance: self.reading_variance + jump * jump * split.variance,
        }
    }
}

impl Default for NonlinearModel {
    fn default() -> Self {
        Self::new()
    }
}

/// A rate split into both directions: expected parts, probabilities, and the remaining variance.
struct Split {
    extend: f64,
    retract: f64,
    extends: f64,
    retracts: f64,
    variance: f64,
}

impl Split {
    /// Splits a rate with the density `35/32 (1 - u²)³` at `u` = three deviations.
    #[inline(always)]
    fn of(rate: f64, variance: f64) -> Self {
        if rate * rate >= 9.0 * variance {
            let (extends, retracts) = if rate > 0.0 { (1.0, 0.0) } else { (0.0, 1.0) };
            return Self { extend: extends * rate, retract: retracts * rate, extends, retracts, variance: 0.0 };
        }
        let width = 3.0 * variance.sqrt();
        let u = rate / width;
        let w = u * u;
        let lean = u * (35.0 / 32.0) * (1.0 - w * (1.0 - w * (0.6 - w * (1.0 / 7.0))));
        let spread = width * (35.0 / 256.0) * (1.0 + w * (4.0 - w * (2.0 - w * (0.8 - w * (1.0 / 7.0)))));
        let (extends, retracts) = (0.5 + lean, 0.5 - lean);
        Self {
            extend: 0.5 * rate + spread,
            retract: 0.5 * rate - spread,
            extends,
            retracts,
            variance: unexplained(extends, retracts, variance),
        }
    }
}
