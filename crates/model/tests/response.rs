//! The response over one step against 160-digit arithmetic, against Van Loan's matrix exponential, and against itself
//! in two halves.

use nalgebra::SMatrix;
use ohmstrain_model::{Branch, MOTION_STATES as M, Motion, Response, Scalar};
use proptest::prelude::*;

fn branch<T: Scalar>(tau_s: f64) -> Branch<T> {
    Branch {
        tau_s: T::of(tau_s),
        extend_gain: T::one(),
        retract_gain: T::one(),
        extend_gain_slope: T::zero(),
        retract_gain_slope: T::zero(),
    }
}

/// Motion with the given restoring coefficients and noise density, through the public constructors.
fn ou(restoring: [f64; 2], density: f64) -> Motion<f64> {
    let rate_sd = (density / restoring[1] / 2.0).sqrt();
    let strain_sd = if restoring[0] == 0.0 { f64::INFINITY } else { rate_sd / restoring[0].sqrt() };
    Motion::ornstein_uhlenbeck(1.0 / restoring[1], rate_sd, 0.0, strain_sd).unwrap()
}

/// Impulse response, its integral and the noise covariance of motion and branches in one vector or matrix.
fn collect<T: Scalar, const B: usize, const N: usize>(response: &Response<T, B>) -> ([T; N], [T; N], [[T; N]; N]) {
    let mut impulse = [T::zero(); N];
    let mut input = [T::zero(); N];
    let mut noise = [[T::zero(); N]; N];
    for i in 0..N {
        if i < M {
            let identity = if i == M - 1 { T::one() } else { T::zero() };
            impulse[i] = response.motion_change[i][M - 1] + identity;
            input[i] = response.input[i];
        } else {
            impulse[i] = response.drive[i - M][M - 1];
            input[i] = response.drive_input[i - M];
        }
        for j in 0..N {
            noise[i][j] = match (i < M, j < M) {
                (true, true) => response.motion_noise[i][j],
                (false, true) => response.cross_noise[i - M][j],
                (true, false) => response.cross_noise[j - M][i],
                (false, false) => response.branch_noise[i - M][j - M],
            };
        }
    }
    (impulse, input, noise)
}

/// Compares with a fixture row. Every number is a sum of terms of one sign over at most 25 doublings of a dozen rounded
/// operations each, 25 · 12 · ε = 7e-14 in f64; sums over decaying modes of both signs lose up to a digit more.
/// Relative to √(Qᵢᵢ Qⱼⱼ) for the covariance; relative to the largest entry of the same kind where a response has
/// decayed away.
fn check<T: Scalar>(response: &Response<T, 2>, row: &[f64], tolerance: f64, what: &str) {
    const N: usize = 4;
    let (impulse, input, noise) = collect::<T, 2, N>(response);
    let to = |x: T| nalgebra::try_convert::<T, f64>(x).unwrap();
    let dt = to(response.dt_s);
    for i in 0..N {
        // A unit push moves component i by at most dt^(M-i) before anything decays.
        let reach = dt.min(1.0).powi((M as i32 - 1 - i as i32).max(0));
        for (name, got, expected) in [("impulse", to(impulse[i]), row[i]), ("integral", to(input[i]), row[N + i])] {
            let scale = expected.abs().max(1e-2 * reach * if name == "impulse" { 1.0 } else { dt.min(1.0) });
            assert!(
                (got - expected).abs() <= tolerance * scale,
                "{what}: {name}[{i}] = {got:e}, expected {expected:e}"
            );
        }
        for j in 0..=i {
            let q = |i: usize, j: usize| row[2 * N + i * (i + 1) / 2 + j];
            let (got, expected) = (to(noise[i][j]), q(i, j));
            let scale = (q(i, i) * q(j, j)).sqrt();
            assert!(
                (got - expected).abs() <= tolerance * scale,
                "{what}: Q[{i}][{j}] = {got:e}, expected {expected:e}"
            );
        }
    }
}

/// Restoring coefficients, time constants, step, reference numbers.
type Case = ([f64; 2], [f64; 2], f64, Vec<f64>);

fn fixture() -> Vec<Case> {
    include_str!("fixtures/response.csv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            ([cells[0], cells[1]], [cells[2], cells[3]], cells[4], cells[5..].to_vec())
        })
        .collect()
}

#[test]
fn agrees_with_160_digits_from_a_millisecond_to_a_million_seconds() {
    for (restoring, taus, dt, row) in fixture() {
        let what = format!("restoring {restoring:?}, tau {taus:?}, dt {dt}");
        check(&Response::new(&ou(restoring, 2.5), &taus.map(branch), dt), &row, 1e-12, &what);
    }
}

#[test]
fn agrees_with_160_digits_in_f32() {
    for ([a, b], taus, dt, row) in fixture() {
        let what = format!("f32, restoring {:?}, tau {taus:?}, dt {dt}", [a, b]);
        // The inputs themselves are rounded to 6e-8, and a rate rounded by ε is wrong by ε · dt/τ in the exponent:
        // compare where that is small.
        if dt > 1.0 {
            continue;
        }
        let rate_sd = (2.5 / b / 2.0_f64).sqrt();
        let strain_sd = if a == 0.0 { f32::INFINITY } else { (rate_sd / a.sqrt()) as f32 };
        let motion = Motion::ornstein_uhlenbeck((1.0 / b) as f32, rate_sd as f32, 0.0, strain_sd).unwrap();
        check(&Response::new(&motion, &taus.map(branch::<f32>), dt as f32), &row, 3e-5, &what);
    }
}

/// Transition and noise by Van Loan (IEEE Trans. Autom. Control 23 (1978) 395), in time units of the step so that the
/// exponential has nothing large to cancel.
fn van_loan<const N: usize, const D: usize>(
    a: SMatrix<f64, N, N>,
    g: SMatrix<f64, N, N>,
    dt: f64,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>) {
    let mut block = nalgebra::DMatrix::<f64>::zeros(2 * N, 2 * N);
    block.view_mut((0, 0), (N, N)).copy_from(&(-a * dt));
    block.view_mut((0, N), (N, N)).copy_from(&(g * dt));
    block.view_mut((N, N), (N, N)).copy_from(&(a.transpose() * dt));
    let exponential = block.exp();
    let f = SMatrix::<f64, N, N>::from_fn(|i, j| exponential[(N + j, N + i)]);
    let upper = SMatrix::<f64, N, N>::from_fn(|i, j| exponential[(i, N + j)]);
    (f, f * upper)
}

proptest! {
    /// Van Loan's exponential loses `exp(2 λ dt)`: with rates up to 2 and dt up to 1 that is below 55 · 2N · ε ≈ 1e-13.
    #[test]
    fn agrees_with_van_loan(
        pull in 0.01..0.9_f64, per_time in 0.2..2.0_f64, tau_1 in 1.0..30.0_f64, tau_2 in 1.0..30.0_f64,
        dt in 0.3..1.0_f64,
    ) {
        let restoring = [pull, per_time];
        let response = Response::new(&ou(restoring, 1.7), &[branch(tau_1), branch(tau_2)], dt);
        let mut a = SMatrix::<f64, 4, 4>::zeros();
        a[(0, 1)] = 1.0;
        for j in 0..2 {
            a[(1, j)] = -restoring[j];
        }
        for (i, tau) in [(2, tau_1), (3, tau_2)] {
            (a[(i, 1)], a[(i, i)]) = (1.0, -1.0 / tau);
        }
        let mut g = SMatrix::<f64, 4, 4>::zeros();
        g[(1, 1)] = 1.7;
        let (f, q) = van_loan::<4, 8>(a, g, dt);
        let (_, _, noise) = collect::<f64, 2, 4>(&response);
        for i in 0..4 {
            for j in 0..4 {
                let scale = (q[(i, i)] * q[(j, j)]).sqrt();
                prop_assert!((noise[i][j] - q[(i, j)]).abs() < 1e-12 * scale, "Q[{i}][{j}]");
            }
            for j in 0..2 {
                let identity = f64::from(u8::from(i == j));
                let got = if i < 2 { identity + response.motion_change[i][j] } else { response.drive[i - 2][j] };
                prop_assert!((got - f[(i, j)]).abs() < 1e-12, "F[{i}][{j}]");
            }
        }
    }

    /// One step equals two: the flow property, F(a + b) = F(b) F(a) and Q(a + b) = F(b) Q(a) F(b)ᵀ + Q(b).
    #[test]
    fn splitting_a_step_changes_nothing(
        time in -3.0..3.0_f64, tau in -3.0..6.0_f64, first in -4.0..1.0_f64, second in -4.0..1.0_f64,
    ) {
        let motion = Motion::ornstein_uhlenbeck(10_f64.powf(time), 0.3, 0.0, f64::INFINITY).unwrap();
        let branches = [branch(10_f64.powf(tau))];
        let at = |dt: f64| {
            let response = Response::new(&motion, &branches, dt);
            let mut f = SMatrix::<f64, 3, 3>::identity();
            for j in 0..2 {
                for i in 0..2 {
                    f[(i, j)] += response.motion_change[i][j];
                }
                f[(2, j)] = response.drive[0][j];
            }
            f[(2, 2)] += response.decay_change[0];
            let (_, _, noise) = collect::<f64, 1, 3>(&response);
            (f, SMatrix::<f64, 3, 3>::from_fn(|i, j| noise[i][j]))
        };
        let (a, b) = (10_f64.powf(first), 10_f64.powf(second));
        let ((f1, q1), (f2, q2), (f, q)) = (at(a), at(b), at(a + b));
        let (f_split, q_split) = (f2 * f1, f2 * q1 * f2.transpose() + q2);
        for i in 0..3 {
            for j in 0..3 {
                let scale = (q[(i, i)] * q[(j, j)]).sqrt();
                prop_assert!((q_split[(i, j)] - q[(i, j)]).abs() <= 1e-12 * scale, "Q[{i}][{j}]");
                // F's entries are at most the length of the step, or 1.
                prop_assert!((f_split[(i, j)] - f[(i, j)]).abs() <= 1e-13 * (1.0 + a + b), "F[{i}][{j}]");
            }
        }
    }
}
