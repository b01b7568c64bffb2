//! Filters of hypotheses and their smoothers, compared with naive implementations.

mod naive;

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Dwell, Estimator, Evidence, Hypotheses, Imm, Innovation, Logistic, Mixture, PhaseMixture, Reading, Real,
    SignSplit, SparseEkf, State, StepError,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};
use ohmstrain_tests::sensor;

use naive::{Comparison, Naive, Rule};

const DT_S: f64 = 0.01;
const STEPS: usize = 3000;

/// Returns a slow sine with holds, near the limits of [`evidence`], with noise of two frequencies, and a second and a half without
/// readings.
fn reading<T: Real>(k: usize) -> Option<Reading<T>> {
    let t = k as f64;
    let slow = 0.22 + 0.24 * (t * 0.01).sin().clamp(-0.8, 0.8);
    let noise = 1e-3 * ((t * 2.9).sin() + (t * 7.3).cos());
    (k % 7 != 3 && k / 150 != 8).then(|| Reading { value: T::of(slow + noise), extra_variance: T::of(1e-7) })
}

fn evidence<T: Real>(tempering: f64) -> Evidence<T> {
    Evidence { limits: StrainRange { lower: T::of(0.0), upper: T::of(0.2) }, tempering: T::of(tempering) }
}

fn dwell<T: Real>() -> Dwell<T> {
    Dwell::new(T::of(5.0), T::of(1.0), T::of(0.3)).unwrap()
}

/// Returns the sensor of all tests; with a nonzero `phase_rate`, moving phases have a mean rate.
fn model<const B: usize, const N: usize>(phase_rate: f64) -> SwitchedModel<f64, B, N> {
    let model = sensor::<f64, B, N>();
    SwitchedModel::new(*model.law(), model.motion().with_phase_rate(phase_rate).unwrap(), *model.noise()).unwrap()
}

/// Largest differences of a run: of means in prior standard deviations, of covariances relative to the prior's diagonal, of
/// probabilities, and of the reading's innovation and log density. Also the largest number of hypotheses.
#[derive(Debug, Default)]
struct Apart {
    belief: f64,
    weight: f64,
    innovation: f64,
    hypotheses: usize,
}

fn larger(most: &mut f64, apart: f64) {
    // A NaN must not hide behind `max`.
    *most = if apart.is_nan() || apart > *most { apart } else { *most };
}

impl Apart {
    fn add<const N: usize, const L: usize>(
        &mut self,
        (mean, covariance): (SVector<f64, N>, SMatrix<f64, N, N>),
        other: &Belief<f64, N, L>,
        before: &Belief<f64, N, L>,
    ) {
        let sd = |i: usize| before.covariance[(i, i)].max(covariance[(i, i)]).sqrt();
        for i in 0..N {
            larger(&mut self.belief, (mean[i] - other.mean[i]).abs() / sd(i));
            for j in 0..=i {
                let apart = (covariance[(i, j)] - other.covariance[(i, j)]).abs();
                larger(&mut self.belief, apart / (sd(i) * sd(j)));
            }
        }
    }

    fn add_comparison(&mut self, comparison: Option<Comparison>, innovation: Option<Innovation<f64>>) {
        assert_eq!(comparison.is_some(), innovation.is_some());
        if let (Some(comparison), Some(innovation)) = (comparison, innovation) {
            let ((value, variance), log_density) = (comparison.innovation, comparison.log_density);
            larger(&mut self.innovation, (value - innovation.value).abs() / variance.sqrt());
            larger(&mut self.innovation, (innovation.variance / variance - 1.0).abs());
            larger(&mut self.innovation, (innovation.log_likelihood - log_density).abs());
        }
    }

    /// A step is about 50 operations deep (mixing, prediction, truncation, update, merging), and an update subtracts terms up to
    /// tens of times larger than the result: 3000 roundings. Later steps retain rounding differences at most for the run, so the
    /// total is at most their sum. A hypothesis that counts lies within √24 standard deviations of the reading (below e⁻¹² of the
    /// best it is dropped), so half its NIS, and with it its weight, is uncertain by that times the uncertainty of its
    /// innovation.
    fn check(&self) {
        let rounding = STEPS as f64 * 3000.0 * f64::EPSILON;
        let weighed = 24_f64.sqrt() * rounding;
        assert!(self.belief < rounding + weighed && self.weight < weighed && self.innovation < weighed, "{self:?}");
    }
}

/// Runs both independently from the same belief.
fn differences<E, const B: usize, const N: usize, const L: usize>(
    filter: &E,
    start: E::State,
    naive: &Naive<B, N>,
    shares: impl Fn(&E::State) -> Vec<(f64, Phase, Belief<f64, N, L>)>,
) -> Apart
where
    E: Estimator<f64, N, L>,
{
    let (mut state, mut most) = (start, Apart::default());
    let first = shares(&state).into_iter().find(|share| share.0 > 0.0).unwrap();
    let mut own = naive::Hypotheses::single(&first.2, first.1);
    let prepared = filter.prepare(DT_S);
    for k in 0..STEPS {
        let before = state.moments();
        let taken = filter.advance(&state, &prepared, reading(k)).unwrap();
        let (next, comparison) = naive.step::<L>(&own, DT_S, reading(k));
        (state, own) = (taken.state, next);
        most.add_comparison(comparison, taken.innovation);
        most.add(own.moments(), &state.moments(), &before);
        let shares: Vec<_> = shares(&state).into_iter().filter(|share| share.0 > 0.0).collect();
        assert_eq!(shares.len(), own.all.len(), "row {k}");
        for (share, one) in shares.iter().zip(&own.all) {
            assert_eq!(share.1, one.phase, "row {k}");
            larger(&mut most.weight, (share.0 - one.log_weight.exp()).abs());
            most.add((one.mean, one.covariance), &share.2, &before);
        }
        most.hypotheses = most.hypotheses.max(shares.len());
    }
    most
}

fn each_mode<const N: usize, const L: usize>(state: &PhaseMixture<f64, N, L>) -> Vec<(f64, Phase, Belief<f64, N, L>)> {
    state.modes().iter().zip(Phase::ALL).map(|(share, phase)| (share.weight, phase, share.belief)).collect()
}

fn imm<const B: usize, const N: usize, const L: usize>(phase_rate: f64, tempering: f64) -> Apart {
    let (model, evidence) = (model::<B, N>(phase_rate), evidence(tempering));
    let start = PhaseMixture::<f64, N, L>::single(Belief::initial(&model), Phase::Hold);
    let naive = Naive { model, rule: Rule::Imm(dwell()), evidence, room: 3 };
    differences(&Imm::<f64, B, N>::new(model, DT_S, dwell(), evidence).unwrap(), start, &naive, each_mode)
}

fn each<const N: usize, const L: usize, const K: usize>(
    state: &Mixture<f64, N, L, K>,
) -> Vec<(f64, Phase, Belief<f64, N, L>)> {
    state.shares().iter().zip(state.phases()).map(|(share, phase)| (share.weight, *phase, share.belief)).collect()
}

/// Creates a filter whose switch in a pause equals the dense filter's, to rounding.
fn signs<const B: usize, const N: usize, const K: usize>(
    model: SwitchedModel<f64, B, N>,
    dt_s: f64,
    hold: Option<Dwell<f64>>,
    evidence: Evidence<f64>,
) -> SignSplit<f64, B, N, K, Logistic> {
    SignSplit::around(SparseEkf::new(model, dt_s).unwrap(), hold, evidence)
}

fn split<const B: usize, const N: usize, const L: usize, const K: usize>(
    (phase_rate, hold): (f64, Option<Dwell<f64>>),
    tempering: f64,
) -> Apart {
    let (model, evidence) = (model::<B, N>(phase_rate), evidence(tempering));
    let start = Mixture::<f64, N, L, K>::single(Belief::initial(&model), Phase::Extend);
    let naive = Naive { model, rule: Rule::Signs(hold), evidence, room: K };
    differences(&signs::<B, N, K>(model, DT_S, hold, evidence), start, &naive, each)
}

fn histories<const B: usize, const N: usize, const L: usize, const K: usize>(phase_rate: f64, tempering: f64) -> Apart {
    let (model, evidence) = (model::<B, N>(phase_rate), evidence(tempering));
    let start = Mixture::<f64, N, L, K>::single(Belief::initial(&model), Phase::Hold);
    let naive = Naive { model, rule: Rule::Histories(dwell()), evidence, room: K };
    differences(&Hypotheses::<f64, B, N, K>::new(model, DT_S, dwell(), evidence).unwrap(), start, &naive, each)
}

#[test]
fn agree_with_naive_filters_to_rounding() {
    imm::<0, 2, 3>(0.0, 1.0).check();
    imm::<1, 3, 6>(0.05, 1.0).check();
    imm::<1, 4, 10>(0.0, 0.5).check();
    imm::<3, 5, 15>(0.0, 1.0).check();
    let three = imm::<3, 6, 21>(0.0, 1.0);
    three.check();
    assert_eq!(three.hypotheses, 3);
    split::<0, 2, 3, 1>((0.0, None), 1.0).check();
    split::<1, 3, 6, 2>((0.05, None), 1.0).check();
    split::<1, 4, 10, 4>((0.0, Some(dwell())), 0.5).check();
    split::<3, 6, 21, 4>((0.0, Some(dwell())), 1.0).check();
    let eight = split::<3, 6, 21, 8>((0.0, None), 1.0);
    eight.check();
    assert_eq!(eight.hypotheses, 8);
    histories::<0, 2, 3, 4>(0.0, 1.0).check();
    histories::<1, 4, 10, 4>(0.05, 0.5).check();
    let sixteen = histories::<3, 6, 21, 16>(0.0, 0.5);
    sixteen.check();
    assert_eq!(sixteen.hypotheses, 16);
}

/// Step length of the smoothers' runs, s; the constant below is the number of steps.
const SLOW_DT_S: f64 = 0.1;
const PAST: usize = 150;

/// Filters and smooths, both from the same smoothed states of later steps. Returns the largest number of smoothed hypotheses,
/// and the largest difference: of means in filtered standard deviations, of covariances relative to filtered variances, and of
/// probabilities.
fn smoothed_apart<E, const B: usize, const N: usize, const L: usize>(
    filter: &E,
    start: E::State,
    naive: &Naive<B, N>,
    shares: impl Fn(&E::State) -> Vec<(f64, Phase, Belief<f64, N, L>)>,
) -> (usize, f64)
where
    E: Estimator<f64, N, L>,
{
    let prepared = filter.prepare(SLOW_DT_S);
    let first = shares(&start).into_iter().find(|share| share.0 > 0.0).unwrap();
    let (mut states, mut own) = (vec![start], vec![naive::Hypotheses::single(&first.2, first.1)]);
    for k in 0..PAST {
        let taken = filter.advance(&states[k], &prepared, reading(10 * k)).unwrap();
        states.push(taken.state);
        own.push(naive.step::<L>(&own[k], SLOW_DT_S, reading(10 * k)).0);
    }
    let of = |state: &E::State| -> Vec<naive::Smoothed<N>> {
        let followed = shares(state).into_iter();
        followed.map(|(weight, _, belief)| (weight, belief.mean, belief.covariance.to_matrix())).collect()
    };
    let (mut next, mut apart, mut most) = (states[PAST].clone(), 0.0, 0);
    for k in (0..PAST).rev() {
        let followed: Vec<bool> = shares(&states[k]).iter().map(|share| share.0 > 0.0).collect();
        let later: Vec<bool> = shares(&states[k + 1]).iter().map(|share| share.0 > 0.0).collect();
        let smoothed: Vec<_> = of(&next).into_iter().zip(&later).filter_map(|(one, on)| on.then_some(one)).collect();
        let expected = naive.back::<L>(&own[k], (&own[k + 1], &smoothed), SLOW_DT_S);
        next = filter.smooth_back(&states[k], &prepared, reading(10 * k), &next).unwrap();
        let found: Vec<_> = of(&next).into_iter().zip(&followed).filter_map(|(one, on)| on.then_some(one)).collect();
        assert_eq!(found.len(), expected.len(), "row {k}");
        most = most.max(expected.len());
        for ((found, expected), filtered) in found.iter().zip(&expected).zip(&own[k].all) {
            larger(&mut apart, (found.0 - expected.0).abs());
            // Hypotheses with negligible weight are not compared.
            if expected.0 < 1e-6 {
                continue;
            }
            let sd = filtered.covariance.diagonal().map(f64::sqrt);
            for i in (0..N).filter(|i| sd[*i] > 0.0) {
                larger(&mut apart, (found.1[i] - expected.1[i]).abs() / sd[i]);
                for j in (0..=i).filter(|j| sd[*j] > 0.0) {
                    larger(&mut apart, (found.2[(i, j)] - expected.2[(i, j)]).abs() / (sd[i] * sd[j]));
                }
            }
        }
    }
    (most, apart)
}

#[test]
fn smoothers_agree_with_naive_ones() {
    let (model, evidence) = (model::<1, 4>(0.0), evidence(0.7));
    let start = Belief::<f64, 4, 10>::initial(&model);
    let naive = |rule, room| Naive { model, rule, evidence, room };
    let imm = Imm::<f64, 1, 4>::new(model, SLOW_DT_S, dwell(), evidence).unwrap();
    let phases = PhaseMixture::single(start, Phase::Hold);
    let of_imm = smoothed_apart(&imm, phases, &naive(Rule::Imm(dwell()), 3), each_mode);
    let split = signs::<1, 4, 3>(model, SLOW_DT_S, None, evidence);
    let of_signs = smoothed_apart(&split, Mixture::single(start, Phase::Extend), &naive(Rule::Signs(None), 3), each);
    let split = signs::<1, 4, 6>(model, SLOW_DT_S, Some(dwell()), evidence);
    let rule = Rule::Signs(Some(dwell()));
    let with_holds = smoothed_apart(&split, Mixture::single(start, Phase::Extend), &naive(rule, 6), each);
    let histories = Hypotheses::<f64, 1, 4, 8>::new(model, SLOW_DT_S, dwell(), evidence).unwrap();
    let rule = Rule::Histories(dwell());
    let of_histories = smoothed_apart(&histories, Mixture::single(start, Phase::Hold), &naive(rule, 8), each);
    for (most, apart) in [of_imm, of_signs, with_holds, of_histories] {
        // Rounding is amplified by the condition number of nearly singular correlations, below 1e7 after a tenth of a
        // second.
        assert!(most >= 3 && apart < 1e7 * 10.0 * f64::EPSILON, "{most} {apart}");
    }
}

/// The runs above come near the limits: without limits the results would differ.
#[test]
fn the_limits_of_these_runs_count() {
    let model = sensor::<f64, 3, 6>();
    let anywhere = StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY };
    let within = Imm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let free = Imm::new(model, DT_S, dwell(), Evidence { limits: anywhere, tempering: 1.0 }).unwrap();
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
        assert_eq!(Mixture::<f64, 6, 21, 4>::single(belief, phase).phase_probabilities(), expected);
    }
}

/// The oracle is the sum over the parts, written out.
#[test]
fn a_marginal_is_that_of_the_whole_mixture() {
    let model = sensor::<f64, 3, 6>();
    let imm = Imm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let mut state = PhaseMixture::<f64, 6, 21>::single(Belief::initial(&model), Phase::Hold);
    for k in 0..300 {
        imm.step(&mut state, reading(k)).unwrap();
    }
    let [of_strain, of_square] = state.modes().iter().fold([0.0; 2], |[mean, square], mode| {
        let (strain, variance) = (mode.belief.mean[0], mode.belief.covariance[(0, 0)]);
        [mean + mode.weight * strain, square + mode.weight * (variance + strain * strain)]
    });
    let (marginal, moments) = (state.marginal(0), state.moments());
    // Strains of 0.1 with a variance of 1e-4: squares are a hundred times larger than the difference.
    assert!((marginal.mean - of_strain).abs() < 10.0 * f64::EPSILON);
    assert!((marginal.variance - (of_square - of_strain * of_strain)).abs() < 10.0 * f64::EPSILON);
    assert!((marginal.variance / moments.covariance[(0, 0)] - 1.0).abs() < 100.0 * f64::EPSILON);
}

#[test]
fn an_error_leaves_the_state() {
    let model = sensor::<f64, 1, 3>();
    let imm = Imm::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let split = SignSplit::<f64, 1, 3, 4>::new(model, DT_S, None, evidence(1.0)).unwrap();
    let histories = Hypotheses::<f64, 1, 3, 8>::new(model, DT_S, dwell(), evidence(1.0)).unwrap();
    let mut phases = PhaseMixture::<f64, 3, 6>::single(Belief::initial(&model), Phase::Hold);
    let mut signs = Mixture::<f64, 3, 6, 4>::single(Belief::initial(&model), Phase::Extend);
    let mut known = Mixture::<f64, 3, 6, 8>::single(Belief::initial(&model), Phase::Hold);
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
    assert!(Imm::new(model, -0.1, dwell(), evidence(1.0)).is_err());
    assert!(SignSplit::<f64, 1, 3, 4>::new(model, f64::NAN, None, evidence(1.0)).is_err());
}

/// Filters in `f32`, without Joseph's form: readings are exact for a long time, and no step is refused.
#[test]
fn go_on_in_single_precision() {
    let model = sensor::<f32, 3, 6>();
    let imm = Imm::new(model, DT_S as f32, dwell(), evidence(1.0)).unwrap();
    let split = SignSplit::<f32, 3, 6, 4>::new(model, DT_S as f32, Some(dwell()), evidence(1.0)).unwrap();
    let mut phases = PhaseMixture::<f32, 6, 21>::single(Belief::initial(&model), Phase::Hold);
    let mut signs = Mixture::<f32, 6, 21, 4>::single(Belief::initial(&model), Phase::Extend);
    for k in 0..30_000 {
        let reading = Some(Reading::from(0.2 + 0.15 * (k as f32 * 0.003).sin()));
        imm.step(&mut phases, reading).unwrap();
        split.step(&mut signs, reading).unwrap();
    }
}
