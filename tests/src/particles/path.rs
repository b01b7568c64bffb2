//! The model along one path of the motion. Given the path, branches and baseline are linear and Gaussian, with a covariance that
//! does not depend on strain or phase; it is that of a hold.

use nalgebra::SVector;
use ohmstrain_model::{MOTION_STATES as M, Phase, Scalar, StrainRange, SwitchedModel, SwitchedStep, Symmetric};

/// Returns the covariance of the process noise of the motion over a step, and of its effect on branches of unit gain,
/// in the order of the state. The branches' own noise is not included.
pub(crate) fn path_noise<T: Scalar, const B: usize, const N: usize, const L: usize>(
    step: &SwitchedStep<T, B>,
) -> Symmetric<T, N, L> {
    let response = step.response();
    let mut out = Symmetric::zeros();
    for i in 0..M {
        for j in 0..=i {
            out[(i, j)] = response.motion_noise[i][j];
        }
    }
    for i in 0..B {
        for j in 0..M {
            out[(M + i, j)] = response.cross_noise[i][j];
        }
        for k in 0..=i {
            out[(M + i, M + k)] = response.branch_noise[i][k];
        }
    }
    out
}

/// Returns the state after a step with given motion, and the direction in which the body then moves, the sign of its
/// rate.
///
/// - `state`: strain and its derivatives, and means of branches and baseline given the path so far.
/// - `phase`: phase of the body; it determines the rate to which the motion reverts, and whether the body moves at all.
/// - `chance`: a draw with covariance [`path_noise`].
/// - `stops`: strains at which the body is stopped without a rebound: the outward rate is lost, and the branches are
///   driven by the share of the step's path that the body has completed.
///
/// Branches use the gain at the mean of the strains at both ends, for the direction in which the strain moved. The sign
/// of the final rate would be wrong for a step that turns around at its end, which mostly went the other way.
pub(crate) fn along_path<T: Scalar, const B: usize, const N: usize>(
    model: &SwitchedModel<T, B, N>,
    step: &SwitchedStep<T, B>,
    state: &SVector<T, N>,
    phase: Phase,
    chance: &SVector<T, N>,
    stops: &StrainRange<T>,
) -> (SVector<T, N>, Phase) {
    let response = step.response();
    let mut out = *state;
    for i in 0..B {
        out[M + i] += response.decay_change[i] * state[M + i];
    }
    if N == M + B + 1 {
        out[N - 1] += step.baseline_change() * state[N - 1];
    }
    if phase == Phase::Hold {
        out[1] = T::zero();
        return (out, phase);
    }
    let motion = model.motion();
    let toward_rate = if phase == Phase::Extend { motion.phase_rate() } else { -motion.phase_rate() };
    let push = motion.restoring()[0] * motion.rest_strain() + motion.restoring()[1] * toward_rate;
    let answer = |to_state: &[T; M], to_push: T| (0..M).fold(to_push * push, |sum, j| sum + to_state[j] * state[j]);
    for i in 0..M {
        out[i] += answer(&response.motion_change[i], response.input[i]) + chance[i];
    }
    let ends = if out[1] < T::zero() { Phase::Retract } else { Phase::Extend };
    let went = if out[0] < state[0] { Phase::Retract } else { Phase::Extend };
    let share = stop(state[0], &mut out, stops);
    let mid_strain = (state[0] + out[0]) / T::of(2.0);
    for i in 0..B {
        let (gain, _) = model.law().gain(i, mid_strain, went);
        let unit_drive = answer(&response.drive[i], response.drive_input[i]) + chance[M + i];
        out[M + i] += gain * share * unit_drive;
    }
    (out, ends)
}

/// Stops a body that moved from strain `start` to `state` where it leaves `stops`. Returns the share of the path that
/// it completed.
fn stop<T: Scalar, const N: usize>(start: T, state: &mut SVector<T, N>, stops: &StrainRange<T>) -> T {
    let free = state[0];
    let stopped = stops.clamp(free);
    if stopped == free {
        return T::one();
    }
    state[0] = stopped;
    if state[1] * (free - stopped) > T::zero() {
        state[1] = T::zero();
    }
    let way = free - start;
    if way.is_zero() { T::zero() } else { ((stopped - start) / way).max(T::zero()).min(T::one()) }
}
