//! The sparse filters of hypotheses compute what the generic ones compute.

mod apart;
mod pairs;

use ohmstrain_ekf::{
    Belief, Dwell, Evidence, Gaussian, Mixture, PhaseMixture, Reading, Real, SparseHypotheses, SparseImm,
    SparseMixture, SparseSignSplit, State, StepError,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};
use ohmstrain_tests::sensor;

use apart::Apart;
use pairs::{Histories, Imms, Pair, Splits};

const DT_S: f64 = 0.01;
const STEPS: usize = 3000;

/// A slow sine with holds, near the limits of [`evidence`], with noise of two frequencies, and a second without readings.
fn reading<T: Real>(k: usize) -> Option<Reading<T>> {
    let t = k as f64;
    let slow = 0.22 + 0.24 * (t * 0.01).sin().clamp(-0.8, 0.8);
    let noise = 1e-3 * ((t * 2.9).sin() + (t * 7.3).cos());
    (k % 7 != 3 && k / 100 != 12).then(|| Reading { value: T::of(slow + noise), extra_variance: T::of(1e-7) })
}

fn evidence<T: Real>(tempering: f64) -> Evidence<T> {
    Evidence { limits: StrainRange { lower: T::of(0.0), upper: T::of(0.2) }, tempering: T::of(tempering) }
}

fn dwell<T: Real>() -> Dwell<T> {
    Dwell::new(T::of(5.0), T::of(1.0), T::of(0.3)).unwrap()
}

/// Every step from the same state; `on_its_own`, the generic filter goes its own way.
fn differences<T: Real, P: Pair<T, N, L, K>, const N: usize, const L: usize, const K: usize>(
    pair: &P,
    mut state: P::State,
    on_its_own: bool,
) -> Apart {
    // In single precision which of two hypotheses is the nearer one may be decided by rounding. Whichever two are merged, mean
    // and covariance of all stay what they are.
    let mut most = Apart::new(size_of::<T>() < size_of::<f64>());
    let mut own: Mixture<T, N, L, K> = state.clone().into();
    for k in 0..STEPS {
        let from = if on_its_own { own } else { state.clone().into() };
        let generic = pair.generic(&from, reading(k));
        let prediction = pair.generic(&from, None).posterior;
        let residual = pair.sparse(&mut state, reading(k));
        most.add(&state.clone().into(), residual, &generic, &prediction);
        own = generic.posterior;
    }
    most
}

/// The sensor of all tests; with `phase_rate`, moving phases have a mean rate.
fn model<T: Real, const B: usize, const N: usize>(phase_rate: f64) -> SwitchedModel<T, B, N> {
    let model = sensor::<T, B, N>();
    SwitchedModel::new(*model.law(), model.motion().with_phase_rate(T::of(phase_rate)).unwrap(), *model.noise())
        .unwrap()
}

fn imm<T: Real, const B: usize, const N: usize, const L: usize>(
    phase_rate: f64,
    tempering: f64,
    on_its_own: bool,
) -> Apart {
    let model = model::<T, B, N>(phase_rate);
    let start = PhaseMixture::<T, N, L>::single(Belief::initial(&model), Phase::Hold);
    differences(&Imms::new(model, tempering), start, on_its_own)
}

fn split<T: Real, const B: usize, const N: usize, const L: usize, const K: usize>(
    (phase_rate, hold): (f64, Option<Dwell<T>>),
    tempering: f64,
    on_its_own: bool,
) -> Apart {
    let model = model::<T, B, N>(phase_rate);
    let start = SparseMixture::<T, N, L, K>::single(Belief::initial(&model), Phase::Extend);
    differences(&Splits::<T, B, N, K>::new(model, hold, tempering), start, on_its_own)
}

fn histories<T: Real, const B: usize, const N: usize, const L: usize, const K: usize>(
    phase_rate: f64,
    tempering: f64,
    on_its_own: bool,
) -> Apart {
    let model = model::<T, B, N>(phase_rate);
    let start = SparseMixture::<T, N, L, K>::single(Belief::initial(&model), Phase::Hold);
    differences(&Histories::<T, B, N, K>::new(model, tempering), start, on_its_own)
}

/// A step is some 50 operations deep: mixing, prediction, cut, update, merging. The generic path subtracts products of a
/// gain with Joseph's form, which are up to some tens of times larger than what is left.
const ROUNDING: f64 = 3000.0;

#[test]
fn agree_with_the_generic_filters_to_rounding() {
    let rounding = ROUNDING * f64::EPSILON;
    imm::<f64, 0, 2, 3>(0.0, 1.0, false).check(rounding);
    imm::<f64, 1, 3, 6>(0.05, 1.0, false).check(rounding);
    imm::<f64, 1, 4, 10>(0.0, 0.5, false).check(rounding);
    imm::<f64, 3, 5, 15>(0.0, 1.0, false).check(rounding);
    imm::<f64, 3, 6, 21>(0.0, 1.0, false).check(rounding);
    split::<f64, 0, 2, 3, 1>((0.0, None), 1.0, false).check(rounding);
    split::<f64, 1, 3, 6, 2>((0.05, None), 1.0, false).check(rounding);
    split::<f64, 1, 4, 10, 4>((0.0, Some(dwell())), 0.5, false).check(rounding);
    split::<f64, 3, 6, 21, 4>((0.0, Some(dwell())), 1.0, false).check(rounding);
    let eight = split::<f64, 3, 6, 21, 8>((0.0, None), 1.0, false);
    eight.check(rounding);
    assert_eq!(eight.hypotheses, 8);
    histories::<f64, 0, 2, 3, 4>(0.0, 1.0, false).check(rounding);
    histories::<f64, 1, 4, 10, 4>(0.05, 0.5, false).check(rounding);
    let sixteen = histories::<f64, 3, 6, 21, 16>(0.0, 0.5, false);
    sixteen.check(rounding);
    assert_eq!(sixteen.hypotheses, 16);
    let single = ROUNDING * f64::from(f32::EPSILON);
    let phases = imm::<f32, 3, 6, 21>(0.0, 1.0, false);
    phases.check(single);
    assert_eq!(phases.hypotheses, 3);
    split::<f32, 3, 6, 21, 4>((0.0, None), 1.0, false).check(single);
    histories::<f32, 3, 6, 21, 8>(0.0, 1.0, false).check(single);
}

/// What one step rounds differently is remembered by later ones, no longer than the run: no more than the sum of all. What
/// does not show in a single step would: how much of the limits a hypothesis has already been weighed by.
#[test]
fn stay_with_the_generic_filters() {
    let rounding = STEPS as f64 * ROUNDING * f64::EPSILON;
    imm::<f64, 1, 4, 10>(0.0, 0.5, true).check(rounding);
    imm::<f64, 3, 6, 21>(0.0, 1.0, true).check(rounding);
    split::<f64, 3, 6, 21, 4>((0.0, Some(dwell())), 1.0, true).check(rounding);
    split::<f64, 3, 6, 21, 8>((0.0, None), 1.0, true).check(rounding);
    histories::<f64, 3, 6, 21, 16>(0.0, 0.5, true).check(rounding);
}

/// The runs above come near the limits: without them the filters would say something else.
#[test]
fn the_limits_of_these_runs_count() {
    let model = sensor::<f64, 3, 6>();
    let anywhere = StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY };
    let within = SparseImm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let free = SparseImm::new(model, DT_S, dwell(), Evidence { limits: anywhere, tempering: 1.0 }).unwrap();
    let start = PhaseMixture::<f64, 6, 21>::single(Belief::initial(&model), Phase::Hold);
    let (mut a, mut b, mut apart) = (start, start, 0.0_f64);
    for k in 0..STEPS {
        within.step(&mut a, reading(k)).unwrap();
        free.step(&mut b, reading(k)).unwrap();
        apart = apart.max((a.phase_probabilities()[0] - b.phase_probabilities()[0]).abs());
    }
    assert!(apart > 0.01, "{apart}");
}

#[test]
fn a_single_phase_has_all_the_weight() {
    let belief = Belief::<f64, 6, 21>::initial(&sensor::<f64, 3, 6>());
    for phase in Phase::ALL {
        let expected = Phase::ALL.map(|of| f64::from(u8::from(of == phase)));
        assert_eq!(PhaseMixture::single(belief, phase).phase_probabilities(), expected);
        assert_eq!(SparseMixture::<f64, 6, 21, 4>::single(belief, phase).phase_probabilities(), expected);
    }
}

/// The oracle is the sum over the parts, written out.
#[test]
fn a_marginal_is_that_of_the_whole_mixture() {
    let model = sensor::<f64, 3, 6>();
    let imm = SparseImm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let mut state = PhaseMixture::<f64, 6, 21>::single(Belief::initial(&model), Phase::Hold);
    for k in 0..300 {
        imm.step(&mut state, reading(k)).unwrap();
    }
    let [of_strain, of_square] = state.modes().iter().fold([0.0; 2], |[mean, square], mode| {
        let (strain, variance) = (mode.belief.mean[0], mode.belief.covariance[(0, 0)]);
        [mean + mode.weight * strain, square + mode.weight * (variance + strain * strain)]
    });
    let (marginal, moments) = (state.marginal(0), state.moments());
    // Strains of 0.1 with a variance of 1e-4: squares are a hundred times larger than what is left.
    assert!((marginal.mean - of_strain).abs() < 10.0 * f64::EPSILON);
    assert!((marginal.variance - (of_square - of_strain * of_strain)).abs() < 10.0 * f64::EPSILON);
    assert!((marginal.variance / moments.covariance[(0, 0)] - 1.0).abs() < 100.0 * f64::EPSILON);
    // Known to be at 0.1: all of the mixture says so.
    let pinned = state.pinned(0, &Gaussian { mean: 0.1, variance: 0.0 }).unwrap();
    assert!((pinned.marginal(0).mean - 0.1).abs() < 1e-12 && pinned.marginal(0).variance < 1e-12);
}

#[test]
fn an_error_leaves_the_state() {
    let model = sensor::<f64, 1, 3>();
    let imm = SparseImm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let split = SparseSignSplit::<f64, 1, 3, 4>::new(model, DT_S, None, evidence(1.0)).unwrap();
    let histories = SparseHypotheses::<f64, 1, 3, 8>::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let mut phases = PhaseMixture::<f64, 3, 6>::single(Belief::initial(&model), Phase::Hold);
    let mut signs = SparseMixture::<f64, 3, 6, 4>::single(Belief::initial(&model), Phase::Extend);
    let mut known = SparseMixture::<f64, 3, 6, 8>::single(Belief::initial(&model), Phase::Hold);
    for k in 0..100 {
        imm.step(&mut phases, reading(k)).unwrap();
        split.step(&mut signs, reading(k)).unwrap();
        histories.step(&mut known, reading(k)).unwrap();
    }
    let before = (phases, signs, known);
    for (value, extra_variance, error) in [
        (f64::NAN, 0.0, StepError::NonFiniteReading),
        (f64::INFINITY, 0.0, StepError::NonFiniteReading),
        (0.1, f64::NAN, StepError::NonFiniteReading),
        (0.1, -1e3, StepError::NegativeVariance),
    ] {
        let reading = Some(Reading { value, extra_variance });
        assert_eq!(imm.step(&mut phases, reading).unwrap_err(), error);
        assert_eq!(split.step(&mut signs, reading).unwrap_err(), error);
        assert_eq!(histories.step(&mut known, reading).unwrap_err(), error);
    }
    assert_eq!(before, (phases, signs, known));
    assert!(SparseImm::new(model, 0.0, dwell(), evidence(1.0)).is_err());
    assert!(SparseSignSplit::<f64, 1, 3, 4>::new(model, f64::NAN, None, evidence(1.0)).is_err());
}

/// In `f32`, without Joseph's form: readings that are exact for long, and no step is refused.
#[test]
fn go_on_in_single_precision() {
    let model = sensor::<f32, 3, 6>();
    let imm = SparseImm::new(model, DT_S as f32, dwell(), evidence(1.0)).unwrap();
    let split = SparseSignSplit::<f32, 3, 6, 4>::new(model, DT_S as f32, Some(dwell()), evidence(1.0)).unwrap();
    let mut phases = PhaseMixture::<f32, 6, 21>::single(Belief::initial(&model), Phase::Hold);
    let mut signs = SparseMixture::<f32, 6, 21, 4>::single(Belief::initial(&model), Phase::Extend);
    for k in 0..30_000 {
        let reading = Some(Reading::from(0.2 + 0.15 * (k as f32 * 0.003).sin()));
        imm.step(&mut phases, reading).unwrap();
        split.step(&mut signs, reading).unwrap();
    }
}
