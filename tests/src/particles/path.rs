//! The model along one path of the motion. Given the path, branches and baseline are linear and Gaussian, with a covariance that
//! depends on neither strain nor phase: that of a hold.

use nalgebra::SVector;
use ohmstrain_model::{MOTION_STATES as M, Phase, Scalar, StrainRange, SwitchedModel, SwitchedStep, Symmetric};

/// Covariance of what chance adds over a step to the motion, and through it to branches of unit gain, each in its
/// place of the state. The branches' own noise is not part of it.
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

/// The state after a step whose motion is given, and the direction in which the body then moves: the sign of its rate.
///
/// - `state`: strain and its derivatives as they are, means of branches and baseline given the path so far.
/// - `phase`: what the body is about; it decides what the rate reverts to and whether the body moves at all.
/// - `chance`: a draw with covariance [`path_noise`].
/// - `stops`: strains at which the body is stopped for good, without a rebound: the rate outward is
///   lost, and the branches are driven by that share of the step's path that the body has gone.
///
/// Branches see the gain at the middle of the strains at both ends, and of the direction in which the strain went: the
/// rate at the end is that of an instant, and a step that turns around there has mostly gone the other way.
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

/// Stops a body that went from strain `start` to `state` where it left `stops`; the share of the way that it went.
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
