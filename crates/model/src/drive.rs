use nalgebra::SVector;

use crate::motion::MOTION_STATES as M;
use crate::{Direction, Phase, Scalar, SwitchedModel, SwitchedStep, Transition};

impl<T: Scalar, const B: usize, const N: usize> SwitchedModel<T, B, N> {
    /// Drives the branches by the motion: gain at mid-strain times mean rate over the step.
    ///
    /// The noise of branch i is `γᵢ wᵢ + strain_pull · n_ε`, because its gain depends on the path of the motion. The noise of an
    /// uncertain direction, one number for all branches, is added.
    pub(crate) fn drive_branches<const L: usize>(
        &self,
        step: &SwitchedStep<T, B>,
        state: &SVector<T, N>,
        direction: Direction<T>,
        out: &mut Transition<T, N, L>,
    ) {
        let response = &step.response;
        let mid_strain = (state[0] + out.mean[0]) / T::of(2.0);
        let push = self.push(direction);
        let (mut gain, mut strain_pull, mut jump) = ([T::zero(); B], [T::zero(); B], [T::zero(); B]);
        // All branches are driven by about the same rate, so the variance due to its uncertain direction is taken from
        // the first.
        let mut unexplained = T::zero();
        for i in 0..B {
            let mut unit_drive = response.drive_input[i] * push;
            for j in 0..M {
                unit_drive += response.drive[i][j] * state[j];
            }
            // The constant rate over the step that drives the branch as much as the motion does.
            let reach_s = -response.decay_change[i] * self.law().branches[i].tau_s;
            if !(reach_s > T::zero()) {
                continue; // a step of zero seconds
            }
            let rate = direction.split(unit_drive / reach_s);
            let (extend, extend_slope) = self.law().gain(i, mid_strain, Phase::Extend);
            let (retract, retract_slope) = self.law().gain(i, mid_strain, Phase::Retract);
            gain[i] = rate.slope(extend, retract);
            jump[i] = reach_s * (extend - retract);
            if i == 0 {
                unexplained = rate.variance * direction.persistence();
            }
            strain_pull[i] = reach_s * rate.drive(extend_slope, retract_slope) / T::of(2.0);
            let c = M + i;
            out.mean[c] += reach_s * rate.drive(extend, retract);
            for j in 0..M {
                out.jacobian[(c, j)] = gain[i] * response.drive[i][j] + strain_pull[i] * out.jacobian[(0, j)];
            }
            out.jacobian[(c, 0)] += strain_pull[i];
        }
        for i in 0..B {
            let cross = |j: usize| gain[i] * response.cross_noise[i][j] + strain_pull[i] * response.motion_noise[0][j];
            for j in 0..M {
                out.noise[(M + i, j)] += cross(j);
            }
            for k in 0..=i {
                out.noise[(M + i, M + k)] += unexplained * jump[i] * jump[k]
                    + strain_pull[k] * cross(0)
                    + gain[k] * (gain[i] * response.branch_noise[i][k] + strain_pull[i] * response.cross_noise[k][0]);
            }
        }
    }
}
