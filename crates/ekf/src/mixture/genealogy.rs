//! Who descended from whom in a step of a sparse filter: its smoother goes back along what ran forward. A dense filter that
//! takes the same step again merges and drops to rounding as the sparse one did, and at the edge of such a decision that is
//! not the same.

use ohmstrain_model::Phase;

use crate::belief::gaussian::Real;
use crate::mixture::Added;
use crate::mixture::lineage::{Birth, Lineage, Recorder};

/// Hears where every child of a sparse step went. The filter itself listens with `()`.
pub(crate) trait Heirs {
    /// A child went there.
    fn placed(&mut self, _parent: usize, _phase: Phase, _added: Added) {}
    /// The contents of every place moved to another one, or nowhere.
    fn renumbered(&mut self, _new_place: impl Fn(usize) -> Option<usize>) {}
}

impl Heirs for () {}

/// The place in the new mixture of each child, by parent and phase.
pub(crate) struct Genealogy<const K: usize>([[Option<usize>; 3]; K]);

impl<const K: usize> Genealogy<K> {
    pub(crate) const fn new() -> Self {
        Self([[None; 3]; K])
    }
}

impl<const K: usize> Heirs for Genealogy<K> {
    fn placed(&mut self, parent: usize, phase: Phase, added: Added) {
        let heir = match added {
            Added::To(heir) => Some(heir),
            Added::InsteadOf(heir, into) => {
                self.renumbered(|place| if place == heir { into } else { Some(place) });
                Some(heir)
            }
            Added::Nowhere => None,
        };
        if let Some(place) = self.0.get_mut(parent).and_then(|phases| phases.get_mut(phase.index())) {
            *place = heir;
        }
    }

    fn renumbered(&mut self, new_place: impl Fn(usize) -> Option<usize>) {
        for heir in self.0.iter_mut().flatten() {
            *heir = heir.and_then(&new_place);
        }
    }
}

/// Records a dense step's births as if they had gone where a sparse step put them.
pub(crate) struct Following<'a, T, const N: usize, const L: usize, const K: usize> {
    pub lineage: Lineage<T, N, L, K>,
    pub genealogy: &'a Genealogy<K>,
}

impl<T: Real, const N: usize, const L: usize, const K: usize> Recorder<T, N, L> for Following<'_, T, N, L, K> {
    fn place(&self, parent: usize, phase: Phase, _: Added) -> Added {
        let heir = self.genealogy.0.get(parent).and_then(|phases| *phases.get(phase.index())?);
        heir.map_or(Added::Nowhere, Added::To)
    }

    fn born(&mut self, birth: &Birth<'_, T, N, L>, heir: usize) {
        self.lineage.born(birth, heir);
    }
}

/// The steps of a sparse filter, forward and backwards, around its `step_recorded`.
macro_rules! sparse_steps {
    ($dense:ident) => {
        /// Predicts one step ahead and takes the reading; without one it is a prediction and returns `None`.
        ///
        /// # Errors
        /// See [`StepError`]; the state is untouched.
        #[inline]
        pub fn step<const L: usize>(
            &self,
            state: &mut SparseMixture<T, N, L, K>,
            reading: Option<Reading<T>>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            let mut next = SparseMixture::empty();
            let residual = self.step_into(state, reading, &mut next)?;
            *state = next;
            Ok(residual)
        }

        /// [`Self::step`] into a state that is there already, whatever it was: nothing need be moved.
        ///
        /// # Errors
        /// See [`StepError`]; `next` then means nothing.
        #[inline]
        pub fn step_into<const L: usize>(
            &self,
            state: &SparseMixture<T, N, L, K>,
            reading: Option<Reading<T>>,
            next: &mut SparseMixture<T, N, L, K>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            self.step_recorded(state, reading, next, &mut ())
        }

        /// One step backwards along what [`Self::step`] did: the state before it given all readings, from `filtered` before it,
        /// the reading at its end, and `next`, the state after it given all readings. `dense` is the same filter with its
        /// linearisations, `prepared` its step of the same length.
        ///
        /// # Errors
        /// See [`StepError`]; a step that went forward goes backward.
        pub fn smooth_back<const L: usize>(
            &self,
            dense: &$crate::$dense<T, SwitchedModel<T, B, N>, K>,
            prepared: &(ohmstrain_model::SwitchedStep<T, B>, T),
            filtered: &SparseMixture<T, N, L, K>,
            reading: Option<Reading<T>>,
            next: &SparseMixture<T, N, L, K>,
        ) -> Result<SparseMixture<T, N, L, K>, StepError> {
            let (mut genealogy, mut heirs) = ($crate::mixture::genealogy::Genealogy::<K>::new(), *filtered);
            self.step_recorded(filtered, reading, &mut heirs, &mut genealogy)?;
            let lineage = $crate::mixture::lineage::Lineage::new(dense.model());
            let mut following = $crate::mixture::genealogy::Following { lineage, genealogy: &genealogy };
            let from: $crate::Mixture<T, N, L, K> = (*filtered).into();
            dense.step_recorded(&from, prepared, reading, &mut following)?;
            let smoothed = following.lineage.smooth(&from, &heirs.into(), &(*next).into());
            Ok(SparseMixture::from(&smoothed))
        }
    };
}
pub(crate) use sparse_steps;

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test")]
mod tests {
    use nalgebra::vector;
    use ohmstrain_model::{Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};

    use crate::mixture::LIGHTER;
    use crate::{Belief, Estimator, Evidence, Mixture, SignSplit, SparseMixture, SparseSignSplit};

    type Dense = SignSplit<f64, SwitchedModel<f64, 0, 3>, 4>;
    type Sparse = SparseSignSplit<f64, 0, 3, 4>;
    type State = SparseMixture<f64, 3, 6, 4>;

    fn filters() -> (Sparse, Dense) {
        let law = SensorLaw {
            gauge: Gauge::Polynomial { coefficients: [1.5, 0.0, 0.0] },
            extend_viscosity_s: 0.0,
            retract_viscosity_s: 0.0,
            branches: [],
            range: StrainRange { lower: -1.0, upper: 1.0 },
        };
        let motion = Motion::ornstein_uhlenbeck(1.0, 0.01, 0.0, f64::INFINITY).unwrap();
        let noise = ModelNoise { reading_sd: 1e-3, branch_sd: 0.0, baseline_sd: 0.02, baseline_time_s: 30.0 };
        let model = SwitchedModel::new(law, motion, noise).unwrap();
        let evidence = Evidence::new(StrainRange { lower: -9.0, upper: 9.0 }, 1.0).unwrap();
        (Sparse::new(model, 0.1, None, evidence).unwrap(), Dense::new(model, None, evidence))
    }

    /// At strains 0, -0.5 and 0.5, of which there is room for the children of two.
    fn three(weights: [f64; 3]) -> State {
        of(&weights)
    }

    /// The first of these.
    fn of(weights: &[f64]) -> State {
        let mut state = State::empty();
        for (strain, weight) in [0.0, -0.5, 0.5].into_iter().zip(weights.iter().copied()) {
            let (share, phase) = state.one_more().unwrap();
            share.belief = Belief::independent(vector![strain, 0.0, 0.0], &[1e-4, 1e-4, 4e-4]);
            (share.weight, *phase) = (weight, Phase::Extend);
        }
        state
    }

    fn weights(state: &State) -> std::vec::Vec<f64> {
        state.shares().iter().map(|share| share.weight).collect()
    }

    /// Two hypotheses whose weights differ by the margin within which none is the lighter one, as a factor in the sparse filter
    /// and as a logarithm in the dense one: between `1 - m` and `exp(-m)`, the sparse filter keeps the children that came
    /// first, the dense one those of the heavier. The strain is then told to be that of the first, so it was that before.
    #[test]
    fn a_smoother_goes_back_along_what_ran_forward() {
        let (sparse, dense) = filters();
        let prepared = Estimator::<f64, 3, 6>::prepare(&dense, 0.1);
        let between = 0.5 * (1.0 - LIGHTER + (-LIGHTER).exp());
        let state = three([0.998, 1e-3 * between, 1e-3]);
        let mut next = state;
        sparse.step(&mut next, None).unwrap();
        for (share, _) in next.iter_mut() {
            share.weight = if (share.belief.mean[0] + 0.5).abs() < 0.1 { 0.5 } else { 1e-12 };
        }
        let back = sparse.smooth_back(&dense, &prepared, &state, None, &next).unwrap();
        let weights = weights(&back);
        assert!(weights[1] > 0.999 && weights[2] < 1e-9, "{weights:?}");
        assert!((back.shares()[1].belief.mean[0] + 0.5).abs() < 0.01);
        // By their places the two would have been taken for each other.
        let from: Mixture<f64, 3, 6, 4> = state.into();
        let by_place = dense.smooth_back(&from, &prepared, None, &next.into()).unwrap().unwrap();
        assert!(by_place.components()[2].log_weight.exp() > 0.999);
    }

    /// What is negligible is dropped after a step, and the places of the others move up: of two, the second is followed.
    #[test]
    fn what_moves_up_is_followed() {
        let (sparse, dense) = filters();
        let prepared = Estimator::<f64, 3, 6>::prepare(&dense, 0.1);
        let state = of(&[1e-8, 1.0]);
        let mut next = state;
        sparse.step(&mut next, None).unwrap();
        assert!(next.shares().iter().all(|share| (share.belief.mean[0] + 0.5).abs() < 0.1), "the first is not dropped");
        let back = sparse.smooth_back(&dense, &prepared, &state, None, &next).unwrap();
        let weights = weights(&back);
        assert!(weights[0] < 1e-6 && weights[1] > 0.999, "{weights:?}");
        let (known, smoothed) = (&state.shares()[1].belief, &back.shares()[1].belief);
        assert!((known.mean - smoothed.mean).amax() < 1e-9, "{smoothed:?}");
        let from: Mixture<f64, 3, 6, 4> = state.into();
        let next = dense.advance(&from, &prepared, None).unwrap().state;
        let back = dense.smooth_back(&from, &prepared, None, &next).unwrap().unwrap();
        let by_dense: std::vec::Vec<f64> = back.components().iter().map(|c| c.log_weight.exp()).collect();
        assert!(by_dense[0] < 1e-6 && by_dense[1] > 0.999, "{by_dense:?}");
    }

    /// What says nothing new changes no weight, by the law of total probability. Without a reading nothing is lost: what there
    /// is no room for is merged with the nearest, whether it was displaced (the last is the heavier) or came too late (the
    /// last is the lighter).
    #[test]
    fn what_was_merged_is_followed() {
        let (sparse, dense) = filters();
        let prepared = Estimator::<f64, 3, 6>::prepare(&dense, 0.1);
        for filtered in [[0.997, 1e-3, 2e-3], [0.997, 2e-3, 1e-3]] {
            let state = three(filtered);
            let mut next = state;
            sparse.step(&mut next, None).unwrap();
            let back = weights(&sparse.smooth_back(&dense, &prepared, &state, None, &next).unwrap());
            for (back, filtered) in back.iter().zip(filtered) {
                assert!((back / filtered - 1.0).abs() < 1e-9, "{back} after all, {filtered} before");
            }
        }
    }
}
