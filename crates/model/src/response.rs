use crate::motion::MOTION_STATES as M;
use crate::{Branch, Motion, Scalar};

/// Response of the motion and of branches of unit gain over one time step: the part of the transition that depends on the
/// step's length but not on the state. Compute it once for a fixed step.
///
/// With m the motion states (ε, v) and c a branch of gain 1,
/// `m' = m + motion_change · m + input · u + n`, `c' = c + decay_change · c + drive · m + drive_input · u + w`,
/// with u a constant push on the rate, and n and w Gaussian. Changes are stored instead of transitions, because a
/// transition close to the identity has lost the significant digits, above all in `f32`.
///
/// Textbook formulas for these integrals subtract nearly equal numbers when the step is short against a time
/// constant. Here they are Taylor and Gauss-Legendre sums, of terms of one sign, over a step so short that both are
/// exact to rounding. The step is then doubled as often as needed. Nothing cancels, for any ratio of step to time
/// constant, even in `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response<T, const B: usize> {
    /// Length of the step, s.
    pub dt_s: T,
    /// Transition of the motion, less the identity.
    pub motion_change: [[T; M]; M],
    /// Response of the motion to a unit push.
    pub input: [T; M],
    /// Covariance of n.
    pub motion_noise: [[T; M]; M],
    /// `exp(-dt/τ) - 1` of each branch.
    pub decay_change: [T; B],
    /// Contribution of each motion state at the start to each branch.
    pub drive: [[T; M]; B],
    /// Response of each branch to a unit push.
    pub drive_input: [T; B],
    /// Covariance of w with n.
    pub cross_noise: [[T; M]; B],
    /// Covariance of w.
    pub branch_noise: [[T; B]; B],
}

/// A step counts as short when `fastest rate · h ≤ 1/8`. The eigenvalues of the motion are at most twice the fastest
/// rate (Fujiwara's bound), so `|λ h| ≤ 1/4` there.
const SHORT: f64 = 0.125;

/// Terms of the Taylor sums: the first one left out is below `14² · 4⁻¹⁴/14!` ≈ 1e-17 of the sum.
const TERMS: usize = 14;

/// Gauss-Legendre nodes and weights on [0, 1] (Abramowitz & Stegun, table 25.4). Seven points leave an error below
/// 1e-17 of the integral of `s⁴ exp(2 λ s)`, the worst integrand here, at `|λ h| ≤ 1/4`.
///
/// Each literal becomes `T` at compile time. A table of `f64` would be converted at run time, in software on a
/// microcontroller.
fn nodes<T: Scalar>() -> [(T, T); 7] {
    [
        (T::of(0.0254460438286207), T::of(0.06474248308443487)),
        (T::of(0.12923440720030277), T::of(0.13985269574463843)),
        (T::of(0.2970774243113014), T::of(0.19091502525255935)),
        (T::of(0.5), T::of(0.20897959183673465)),
        (T::of(0.7029225756886985), T::of(0.19091502525255935)),
        (T::of(0.8707655927996972), T::of(0.13985269574463843)),
        (T::of(0.9745539561713793), T::of(0.06474248308443487)),
    ]
}

/// Doublings allowed: enough for a step 10¹⁵ times longer than the fastest time constant.
const MOST_DOUBLINGS: u32 = 52;

impl<T: Scalar, const B: usize> Response<T, B> {
    /// Computes the response over `dt_s ≥ 0` seconds.
    #[must_use]
    pub fn new(motion: &Motion<T>, branches: &[Branch<T>; B], dt_s: T) -> Self {
        let mut fastest = motion.fastest_rate();
        for branch in branches {
            fastest = fastest.max(T::one() / branch.tau_s);
        }
        let (mut h, mut doublings) = (dt_s, 0);
        while h * fastest > T::of(SHORT) && doublings < MOST_DOUBLINGS {
            h /= T::of(2.0);
            doublings += 1;
        }
        let mut response = Self::short(motion, branches, h);
        for _ in 0..doublings {
            response = response.doubled();
        }
        response.dt_s = dt_s;
        response
    }

    /// Computes the response over a step `h` that is short compared with every time constant.
    fn short(motion: &Motion<T>, branches: &[Branch<T>; B], h: T) -> Self {
        let mut out = Self {
            dt_s: h,
            motion_change: [[T::zero(); M]; M],
            input: [T::zero(); M],
            motion_noise: [[T::zero(); M]; M],
            decay_change: core::array::from_fn(|i| (-h / branches[i].tau_s).exp_m1()),
            drive: [[T::zero(); M]; B],
            drive_input: [T::zero(); B],
            cross_noise: [[T::zero(); M]; B],
            branch_noise: [[T::zero(); B]; B],
        };
        for j in 0..M {
            let series = Series::from_unit(j, motion, branches);
            let (on_motion, on_branches) = series.change_at(h);
            for i in 0..M {
                out.motion_change[i][j] = on_motion[i];
            }
            for i in 0..B {
                out.drive[i][j] = on_branches[i];
            }
            // A push and the noise act on the last motion state.
            if j == M - 1 {
                (out.input, out.drive_input) = series.integral(h);
                for (node, weight) in nodes() {
                    out.add_noise(&series.at(h * node), motion.noise_density() * h * weight);
                }
            }
        }
        out
    }

    /// Adds `weight · H Hᵀ` of an impulse response H to the noise.
    fn add_noise(&mut self, (on_motion, on_branches): &([T; M], [T; B]), weight: T) {
        for i in 0..M {
            for j in 0..M {
                self.motion_noise[i][j] += weight * on_motion[i] * on_motion[j];
            }
        }
        for i in 0..B {
            for j in 0..M {
                self.cross_noise[i][j] += weight * on_branches[i] * on_motion[j];
            }
            for j in 0..B {
                self.branch_noise[i][j] += weight * on_branches[i] * on_branches[j];
            }
        }
    }

    /// Returns the response over twice the step: this one applied twice.
    fn doubled(&self) -> Self {
        let change = &self.motion_change;
        let forward = |x: &[T; M]| add(mul_vec(change, x), x);
        let transposed: [[T; M]; M] = core::array::from_fn(|i| core::array::from_fn(|j| change[j][i]));
        let backward = |x: &[T; M]| add(mul_vec(&transposed, x), x);
        let mut out = *self;
        out.dt_s = self.dt_s + self.dt_s;
        out.input = add(forward(&self.input), &self.input);
        for j in 0..M {
            // (I + X)² - I = X + (I + X) X, column by column; F Q Fᵀ row by row of the symmetric F Q.
            let column = core::array::from_fn(|i| change[i][j]);
            let twice = add(forward(&column), &column);
            for i in 0..M {
                out.motion_change[i][j] = twice[i];
            }
        }
        let half_spread: [[T; M]; M] = core::array::from_fn(|i| forward(&self.motion_noise[i]));
        for j in 0..M {
            let spread = forward(&core::array::from_fn(|i| half_spread[i][j]));
            for i in 0..M {
                out.motion_noise[i][j] = spread[i] + self.motion_noise[i][j];
            }
        }
        for i in 0..B {
            self.double_branch(i, forward, backward, &mut out);
        }
        out
    }

    fn double_branch(
        &self,
        i: usize,
        forward: impl Fn(&[T; M]) -> [T; M],
        backward: impl Fn(&[T; M]) -> [T; M],
        out: &mut Self,
    ) {
        let decay = T::one() + self.decay_change[i];
        let drive = &self.drive[i];
        out.decay_change[i] = self.decay_change[i] + decay * self.decay_change[i];
        out.drive[i] = add(backward(drive), &drive.map(|x| decay * x));
        out.drive_input[i] = decay * self.drive_input[i] + dot(drive, &self.input) + self.drive_input[i];
        let carried = add(mul_vec(&self.motion_noise, drive), &self.cross_noise[i].map(|x| decay * x));
        out.cross_noise[i] = add(forward(&carried), &self.cross_noise[i]);
        for j in 0..B {
            let other_decay = T::one() + self.decay_change[j];
            out.branch_noise[i][j] = self.branch_noise[i][j]
                + dot(&carried, &self.drive[j])
                + other_decay * (dot(drive, &self.cross_noise[j]) + decay * self.branch_noise[i][j]);
        }
    }
}

/// Taylor coefficients, in time, of motion and branches of unit gain from a unit initial state.
struct Series<T, const B: usize> {
    motion: [[T; M]; TERMS],
    branches: [[T; B]; TERMS],
}

impl<T: Scalar, const B: usize> Series<T, B> {
    /// Computes the series that starts from motion state `start` = 1 and everything else 0.
    fn from_unit(start: usize, motion: &Motion<T>, branches: &[Branch<T>; B]) -> Self {
        let mut series = Self { motion: [[T::zero(); M]; TERMS], branches: [[T::zero(); B]; TERMS] };
        series.motion[0][start] = T::one();
        let mut order = T::zero();
        for n in 1..TERMS {
            let (state, relaxation) = (series.motion[n - 1], series.branches[n - 1]);
            order += T::one();
            for j in 1..M {
                series.motion[n][j - 1] = state[j] / order;
            }
            series.motion[n][M - 1] = -dot(motion.restoring(), &state) / order;
            for i in 0..B {
                series.branches[n][i] = (state[1] - relaxation[i] / branches[i].tau_s) / order;
            }
        }
        series
    }

    /// Returns motion and branches at time `s`.
    fn at(&self, s: T) -> ([T; M], [T; B]) {
        let (on_motion, on_branches) = self.change_at(s);
        (add(on_motion, &self.motion[0]), on_branches)
    }

    /// Returns their change from time 0 to `s` (Horner).
    fn change_at(&self, s: T) -> ([T; M], [T; B]) {
        let mut out = ([T::zero(); M], [T::zero(); B]);
        for n in (1..TERMS).rev() {
            for i in 0..M {
                out.0[i] = (out.0[i] + self.motion[n][i]) * s;
            }
            for i in 0..B {
                out.1[i] = (out.1[i] + self.branches[n][i]) * s;
            }
        }
        out
    }

    /// Returns their integrals from 0 to `h`.
    fn integral(&self, h: T) -> ([T; M], [T; B]) {
        let mut out = ([T::zero(); M], [T::zero(); B]);
        let mut order = T::of(TERMS as f64);
        for n in (0..TERMS).rev() {
            for i in 0..M {
                out.0[i] = out.0[i] * h + self.motion[n][i] / order;
            }
            for i in 0..B {
                out.1[i] = out.1[i] * h + self.branches[n][i] / order;
            }
            order -= T::one();
        }
        (out.0.map(|x| x * h), out.1.map(|x| x * h))
    }
}

fn dot<T: Scalar>(a: &[T; M], b: &[T; M]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (x, y)| sum + *x * *y)
}

fn add<T: Scalar>(a: [T; M], b: &[T; M]) -> [T; M] {
    core::array::from_fn(|i| a[i] + b[i])
}

fn mul_vec<T: Scalar>(a: &[[T; M]; M], b: &[T; M]) -> [T; M] {
    core::array::from_fn(|i| dot(&a[i], b))
}
