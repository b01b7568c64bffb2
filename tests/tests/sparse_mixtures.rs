//! The sparse filters of hypotheses compute what the generic ones compute.

use ohmstrain_ekf::{
    Belief, Dwell, Dynamics, Evidence, Imm, Mixture, MixtureResidual, MixtureStep, PhaseMixture, Reading, Real,
    SignMixture, SignSplit, SparseImm, SparseSignSplit, State, StepError,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};
use ohmstrain_tests::sensor;

const DT_S: f64 = 0.01;
const STEPS: usize = 3000;

/// A slow sine with holds, near the limits of [`evidence`], with noise of two frequencies.
fn reading<T: Real>(k: usize) -> Option<Reading<T>> {
    let t = k as f64;
    let slow = 0.22 + 0.24 * (t * 0.01).sin().clamp(-0.8, 0.8);
    let noise = 1e-3 * ((t * 2.9).sin() + (t * 7.3).cos());
    (k % 7 != 3).then(|| Reading { value: T::of(slow + noise), extra_variance: T::of(1e-7) })
}

fn evidence<T: Real>(tempering: f64) -> Evidence<T> {
    Evidence { limits: StrainRange { lower: T::of(0.0), upper: T::of(0.2) }, tempering: T::of(tempering) }
}

fn dwell<T: Real>() -> Dwell<T> {
    Dwell::new(T::of(5.0), T::of(1.0), T::of(0.3)).unwrap()
}

/// A sparse filter and its generic counterpart.
trait Pair<T: Real, const N: usize, const L: usize, const K: usize> {
    type State: State<T, N, L> + Into<Mixture<T, N, L, K>>;
    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>>;
    fn generic(&self, from: &Mixture<T, N, L, K>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, K>;
}

struct Imms<T, const B: usize, const N: usize> {
    sparse: SparseImm<T, B, N>,
    generic: Imm<T, SwitchedModel<T, 2, B, N>>,
}

impl<T: Real, const B: usize, const N: usize> Imms<T, B, N> {
    fn new(model: SwitchedModel<T, 2, B, N>, tempering: f64) -> Self {
        let (dt_s, evidence) = (T::of(DT_S), evidence(tempering));
        let sparse = SparseImm::new(model, dt_s, dwell(), evidence).unwrap();
        Self { sparse, generic: Imm::new(model, dwell(), evidence) }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize> Pair<T, N, L, 3> for Imms<T, B, N> {
    type State = PhaseMixture<T, N, L>;

    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>> {
        self.sparse.step(state, reading).unwrap()
    }

    fn generic(&self, from: &Mixture<T, N, L, 3>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, 3> {
        let prepared = Dynamics::<T, N, L>::prepare(self.generic.model(), T::of(DT_S));
        self.generic.step_prepared(from, &prepared, T::of(DT_S), reading).unwrap()
    }
}

struct Splits<T, const B: usize, const N: usize, const K: usize> {
    sparse: SparseSignSplit<T, B, N, K>,
    generic: SignSplit<T, SwitchedModel<T, 2, B, N>, K>,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> Splits<T, B, N, K> {
    fn new(model: SwitchedModel<T, 2, B, N>, hold: Option<Dwell<T>>, tempering: f64) -> Self {
        let (dt_s, evidence) = (T::of(DT_S), evidence(tempering));
        let sparse = SparseSignSplit::new(model, dt_s, hold, evidence).unwrap();
        Self { sparse, generic: SignSplit::new(model, hold, evidence) }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Pair<T, N, L, K> for Splits<T, B, N, K> {
    type State = SignMixture<T, N, L, K>;

    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>> {
        self.sparse.step(state, reading).unwrap()
    }

    fn generic(&self, from: &Mixture<T, N, L, K>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, K> {
        let prepared = Dynamics::<T, N, L>::prepare(self.generic.model(), T::of(DT_S));
        self.generic.step_prepared(from, &prepared, T::of(DT_S), reading).unwrap()
    }
}

/// The largest differences of a run, each in units of what it may be uncertain by.
#[derive(Debug, Default)]
struct Apart {
    /// Of means in deviations of the prediction, of covariances relative to its diagonals.
    belief: f64,
    /// Of probabilities, and of logarithms of the density of the reading.
    weight: f64,
    density: f64,
    /// Of the innovation in deviations, and of its variance relative to itself.
    innovation: f64,
    /// How many hypotheses there were at most.
    hypotheses: usize,
}

fn number<T: Real>(x: T) -> f64 {
    x.to_subset().unwrap_or(f64::NAN)
}

fn larger(most: &mut f64, apart: f64) {
    // A NaN must not hide behind `max`.
    *most = if apart.is_nan() || apart > *most { apart } else { *most };
}

impl Apart {
    fn add<T: Real, const N: usize, const L: usize, const K: usize>(
        &mut self,
        sparse: &Mixture<T, N, L, K>,
        residual: Option<MixtureResidual<T>>,
        generic: &MixtureStep<T, N, L, K>,
        prediction: &Belief<T, N, L>,
    ) {
        let of_generic = generic.posterior.components();
        assert_eq!(sparse.components().len(), of_generic.len());
        self.hypotheses = self.hypotheses.max(of_generic.len());
        for (a, b) in sparse.components().iter().zip(of_generic) {
            assert_eq!(a.phase, b.phase);
            larger(&mut self.weight, number(a.log_weight.exp() - b.log_weight.exp()).abs());
            let sd: [f64; N] = std::array::from_fn(|i| number(prediction.covariance[(i, i)]).sqrt());
            for i in 0..N {
                larger(&mut self.belief, number(a.belief.mean[i] - b.belief.mean[i]).abs() / sd[i]);
                for j in 0..=i {
                    let apart = number(a.belief.covariance[(i, j)] - b.belief.covariance[(i, j)]).abs();
                    larger(&mut self.belief, apart / (sd[i] * sd[j]));
                }
            }
        }
        assert_eq!(residual.is_some(), generic.innovation.is_some());
        if let (Some(of_sparse), Some(innovation)) = (residual, generic.innovation) {
            let (residual, variance) = (of_sparse.residual, number(innovation.variance));
            larger(&mut self.innovation, number(residual.innovation - innovation.value).abs() / variance.sqrt());
            larger(&mut self.innovation, (number(residual.variance) / variance - 1.0).abs());
            larger(&mut self.density, number(of_sparse.log_likelihood() - generic.log_likelihood).abs());
        }
    }
}

/// Every step from the same state; with `apart`, the generic filter goes its own way.
fn differences<T: Real, P: Pair<T, N, L, K>, const N: usize, const L: usize, const K: usize>(
    pair: &P,
    mut state: P::State,
    on_its_own: bool,
) -> Apart {
    let mut most = Apart::default();
    let mut own: Mixture<T, N, L, K> = state.clone().into();
    for k in 0..STEPS {
        let from = if on_its_own { own } else { state.clone().into() };
        let generic = pair.generic(&from, reading(k));
        let prediction = pair.generic(&from, None).posterior.moments();
        let residual = pair.sparse(&mut state, reading(k));
        most.add(&state.clone().into(), residual, &generic, &prediction);
        own = generic.posterior;
    }
    most
}

fn imm<T: Real, const B: usize, const N: usize, const L: usize>(tempering: f64, on_its_own: bool) -> Apart {
    let model = sensor::<T, B, N>();
    let start = PhaseMixture::<T, N, L>::single(Belief::initial(&model), Phase::Hold);
    differences(&Imms::new(model, tempering), start, on_its_own)
}

fn split<T: Real, const B: usize, const N: usize, const L: usize, const K: usize>(
    hold: Option<Dwell<T>>,
    tempering: f64,
    on_its_own: bool,
) -> Apart {
    let model = sensor::<T, B, N>();
    let start = SignMixture::<T, N, L, K>::single(Belief::initial(&model), Phase::Extend);
    differences(&Splits::<T, B, N, K>::new(model, hold, tempering), start, on_its_own)
}

#[test]
fn look() {
    for own in [false, true] {
        println!("{:?}", imm::<f64, 0, 2, 3>(1.0, own));
        println!("{:?}", imm::<f64, 1, 3, 6>(1.0, own));
        println!("{:?}", imm::<f64, 1, 4, 10>(0.5, own));
        println!("{:?}", imm::<f64, 3, 5, 15>(1.0, own));
        println!("{:?}", imm::<f64, 3, 6, 21>(1.0, own));
        println!("{:?}", imm::<f32, 3, 6, 21>(1.0, own));
        println!("{:?}", split::<f64, 0, 2, 3, 1>(None, 1.0, own));
        println!("{:?}", split::<f64, 1, 3, 6, 2>(None, 1.0, own));
        println!("{:?}", split::<f64, 1, 4, 10, 4>(Some(dwell()), 0.5, own));
        println!("{:?}", split::<f64, 3, 6, 21, 4>(Some(dwell()), 1.0, own));
        println!("{:?}", split::<f64, 3, 6, 21, 8>(None, 1.0, own));
        println!("{:?}", split::<f32, 3, 6, 21, 4>(None, 1.0, own));
    }
}
