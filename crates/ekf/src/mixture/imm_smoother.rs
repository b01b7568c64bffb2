//! One step backwards of [`Imm`]: through the step of every phase, then through the mixing before it.

use nalgebra::SMatrix;
use ohmstrain_model::{Direction, Phase, Symmetric, Transition};

use crate::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::lineage::{Descent, Lineage, through_renewal};
use crate::mixture::moment_match;
use crate::mixture::state::{PhaseMixture, Share};
use crate::smooth::rts_step;
use crate::{Belief, Curve, Imm, Reading, StepError, Switch};

impl<T: Real, const B: usize, const N: usize, S: Switch<T>, G: Curve<T>> Imm<T, B, N, S, G> {
    pub(super) fn back<const L: usize>(
        &self,
        filtered: &PhaseMixture<T, N, L>,
        _: Option<Reading<T>>,
        next: &PhaseMixture<T, N, L>,
    ) -> Result<PhaseMixture<T, N, L>, StepError> {
        let mut mixing = Lineage::<T, N, L, 3>::new();
        let (mut mixed, mut at_start) = (*filtered, *next);
        let step = self.model().prepare(self.kernel.dt_s());
        for phase in Phase::ALL {
            let [mode, back] = [&mut mixed.modes[phase.index()], &mut at_start.modes[phase.index()]];
            mode.weight = self.mix(filtered, phase, &mut mode.belief, &mut mixing);
            if !(mode.weight > T::zero()) {
                continue;
            }
            let mut parts = Parts::of(&mode.belief);
            self.kernel.predict::<T, S>(&mut parts, Course::Known(phase));
            let transition = self.model().transition(&step, &mode.belief.mean, Direction::Known(phase));
            back.belief = rts_step(&mode.belief, &transition, &parts.together(), &back.belief);
        }
        let mut smoothed = *filtered;
        mixing.smooth(smoothed.shares_mut(), mixed.shares(), at_start.shares());
        Ok(smoothed)
    }

    /// Mixes the initial belief of `phase` for this step, and returns its probability; its components are written to `mixing`.
    fn mix<const L: usize>(
        &self,
        filtered: &PhaseMixture<T, N, L>,
        phase: Phase,
        mixed: &mut Belief<T, N, L>,
        mixing: &mut Lineage<T, N, L, 3>,
    ) -> T {
        let joint: [T; 3] = core::array::from_fn(|from| self.chain[from][phase.index()] * filtered.modes[from].weight);
        let total = joint[0] + joint[1] + joint[2];
        let entered = Phase::ALL.map(|from| self.entered(&filtered.modes[from.index()], from, phase));
        for ((from, belief), weight) in Phase::ALL.into_iter().zip(&entered).zip(joint) {
            if !(weight > T::zero()) {
                continue;
            }
            let (jacobian, noise) = (SMatrix::identity(), Symmetric::zeros());
            let mut transition = Transition { mean: belief.mean, jacobian, noise };
            if begins(from, phase) {
                transition = through_renewal(transition, belief.covariance[(1, 1)]);
            }
            let log_weight = weight.ln();
            let descent =
                Descent { transition, predicted: *belief, posterior: *belief, log_weight, component: phase.index() };
            mixing.put(from.index(), phase, Some(descent));
        }
        if total > T::zero() {
            *mixed = moment_match(entered.iter().zip(joint).map(|(belief, weight)| (weight / total, belief)));
        }
        total
    }

    fn entered<const L: usize>(&self, mode: &Share<T, N, L>, from: Phase, phase: Phase) -> Belief<T, N, L> {
        let mut belief = mode.belief;
        if begins(from, phase) {
            let mut parts = Parts::<T, B>::of(&belief);
            parts.renew_rate(self.fresh[phase.index()], true);
            parts.put_into(&mut belief);
        }
        belief
    }
}

fn begins(from: Phase, phase: Phase) -> bool {
    phase != Phase::Hold && from != phase
}
