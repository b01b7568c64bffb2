//! The learned correction against sums written out here.

use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{
    BLOCK, Correction, FEATURES, FeatureScale, InputRows, InputScale, OneSided, Process, ReadingFeatures, RowBlock,
    Simulated, Triangle, block_of, consensus, mixture, settled, stripes,
};
use ohmstrain_model::StrainRange;

/// Two features of the future.
const D: usize = 15;
const ROWS: usize = 12;
const INDUCING: usize = 5;

/// Numbers between -1 and 1 that look like nothing in particular.
fn number(seed: usize) -> f64 {
    let x = (seed as f64 * 12.9898).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

/// Direct, residual, past and future: where their inputs are, the one of the linear part first.
fn sees(p: usize) -> Vec<usize> {
    match p {
        0 => (6..D).collect(),
        1 => (0..D).collect(),
        2 => (6..13).collect(),
        _ => [14, 13].to_vec(),
    }
}

struct Numbers {
    rows: [[f64; D]; ROWS],
    scales: [InputScale<f64>; D],
    weights: [[f64; ROWS]; 4],
    triangles: [[f64; INDUCING * (INDUCING + 1) / 2]; 4],
}

fn numbers() -> Numbers {
    Numbers {
        rows: std::array::from_fn(|k| std::array::from_fn(|i| number(17 * k + i))),
        scales: std::array::from_fn(|i| InputScale {
            mean: number(300 + i),
            sd: 1.5 + number(320 + i),
            lower: number(300 + i) - 2.0,
            upper: number(300 + i) + 2.0,
        }),
        weights: std::array::from_fn(|p| std::array::from_fn(|k| number(400 + 20 * p + k))),
        triangles: std::array::from_fn(|p| std::array::from_fn(|k| 0.3 * number(500 + 20 * p + k))),
    }
}

/// The length scale of an input of a process.
fn length(p: usize, i: usize) -> f64 {
    [1.5, 2.5, 1.2, 1.9][p] * (1.0 + 0.3 * number(700 + 20 * p + i))
}
const MEANS: [f64; 4] = [0.2, -0.1, 0.3, 0.0];
const VARIANCES: [f64; 4] = [0.5, 0.3, 0.4, 0.9];
const NOISES: [f64; 4] = [0.02, 0.01, 0.03, 0.05];
const WIDENINGS: [f64; 4] = [1.3, 2.0, 1.1, 1.7];
const LEAST: [f64; 4] = [0.8, 0.1, 0.7, 0.6];

/// Direct, residual and one-sided processes by the formulas, and the novelty.
fn written_out(numbers: &Numbers, input: &[f64; D], filtered: Gaussian<f64>) -> ([Gaussian<f64>; 4], f64) {
    let inside: Vec<f64> = (0..D).map(|i| input[i].clamp(numbers.scales[i].lower, numbers.scales[i].upper)).collect();
    let x: Vec<f64> = (0..D).map(|i| (inside[i] - numbers.scales[i].mean) / numbers.scales[i].sd).collect();
    let outside = |p: usize| -> f64 {
        let by = |i: usize| length(p, sees(p)[0]) / length(p, i) / numbers.scales[i].sd;
        sees(p).into_iter().map(|i| ((input[i] - inside[i]) * by(i)).powi(2)).sum()
    };
    let mut unknowns = [0.0; 4];
    let members = [0, 1, 2, 3].map(|p| {
        let places = sees(p);
        let first = places[0];
        let kernel = |k: usize| {
            let square: f64 = places.iter().map(|&i| ((x[i] - numbers.rows[k][i]) / length(p, i)).powi(2)).sum();
            (-0.5 * square).exp() + 0.09 * (1.0 + x[first] * numbers.rows[k][first])
        };
        let mean = MEANS[p] + (0..ROWS).map(|k| numbers.weights[p][k] * kernel(k)).sum::<f64>();
        let mut explained = 0.0;
        for i in 0..INDUCING {
            // Row i of the triangle starts after rows of 5, 4, … numbers.
            let start = (0..i).map(|row| INDUCING - row).sum::<usize>();
            let product: f64 = (i..INDUCING).map(|j| numbers.triangles[p][start + j - i] * kernel(j)).sum();
            explained += product * product;
        }
        let prior = 1.0 + 0.09 * (1.0 + x[first] * x[first]);
        let unknown = (1.0 - explained / prior).clamp(0.0, 1.0);
        unknowns[p] = unknown;
        let least = if p == 1 { LEAST[p].max(filtered.variance) } else { LEAST[p] };
        let base = if p == 1 { filtered.mean } else { 0.0 };
        let variance =
            ((prior * VARIANCES[p]).max(least) * unknown + NOISES[p]) * WIDENINGS[p] + 0.03 * 0.7 * outside(p);
        Gaussian { mean: (base + mean).clamp(-2.0, 2.0), variance }
    });
    (members, 1.0 - (1.0 - unknowns[1]) * (-outside(1) / 5.0).exp())
}

fn blocks<T: Copy>(rows: &[[T; D]; ROWS]) -> Vec<RowBlock<T, D>> {
    rows.chunks(BLOCK).filter_map(block_of).collect()
}

macro_rules! correction {
    ($t:ty, $numbers:expr, $sides:expr, $rows:ident, $scales:ident, $weights:ident, $triangles:ident, $correction:ident) => {
        let $rows = blocks(&$numbers.rows.map(|row| row.map(|x| x as $t)));
        let $scales = $numbers.scales.map(|scale| InputScale {
            mean: scale.mean as $t,
            sd: scale.sd as $t,
            lower: scale.lower as $t,
            upper: scale.upper as $t,
        });
        let $weights = $numbers.weights.map(|weights| weights.map(|x| x as $t));
        // Row i of the triangle starts after rows of 5, 4, … numbers.
        let entry = |p: usize, i: usize, j: usize| {
            $numbers.triangles[p][(0..i).map(|row| INDUCING - row).sum::<usize>() + j - i]
        };
        let $triangles = [0, 1, 2, 3].map(|p| stripes(INDUCING, |i, j| entry(p, i, j) as $t).collect::<Vec<_>>());
        let process =
            |p: usize| Process {
                relevance: std::array::from_fn(|i| {
                    if sees(p).contains(&i) { (0.5 / length(p, i).powi(2)) as $t } else { 0.0 }
                }),
                mean: MEANS[p] as $t,
                weights: &$weights[p],
                explained: Triangle::new(&$triangles[p], INDUCING),
                variance: VARIANCES[p] as $t,
                noise: NOISES[p] as $t,
                widening: WIDENINGS[p] as $t,
                least_variance: LEAST[p] as $t,
            };
        let $correction = Correction {
            rows: InputRows::new(&$rows, ROWS),
            scales: &$scales,
            direct: process(0),
            one_sided: $sides.map(|p: usize| OneSided { process: process(p), first: sees(p)[0] }),
            residual: process(1),
            simulated: None,
            limits: StrainRange { lower: -2.0, upper: 2.0 },
            strain_variance: 0.7,
            variance_factor: 0.6,
        };
    };
}

/// A mixture by its moments.
fn mixed(members: &[Gaussian<f64>]) -> Gaussian<f64> {
    let weights: Vec<f64> = members.iter().map(|member| member.variance.powf(-1.5)).collect();
    let moment = |of: &dyn Fn(&Gaussian<f64>) -> f64| {
        let weighted = members.iter().zip(&weights).map(|(member, weight)| weight * of(member));
        weighted.sum::<f64>() / weights.iter().sum::<f64>()
    };
    let mean = moment(&|member| member.mean);
    Gaussian { mean, variance: moment(&|member| member.variance + member.mean.powi(2)) - mean * mean }
}

#[test]
fn all_processes_their_mixture_and_novelty() {
    let numbers = numbers();
    correction!(f64, numbers, [2, 3], rows, scales, weights, triangles, correction);
    let mut contradicted = 0;
    for trial in 0..50 {
        let input: [f64; D] = std::array::from_fn(|i| 3.0 * number(1000 + 10 * trial + i));
        let filtered = Gaussian { mean: input[0], variance: 0.05 * (1.0 + number(9000 + trial)) };
        let corrected = correction.correct(&input, filtered, 1.0);
        let (members, novelty) = written_out(&numbers, &input, filtered);
        // Tens of sums of products of numbers of order one.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
        let same = |a: Gaussian<f64>, b: Gaussian<f64>| close(a.mean, b.mean) && close(a.variance, b.variance);
        let [past, future] = corrected.one_sided;
        let expected = [corrected.direct, corrected.residual, past, future];
        assert!(members.into_iter().zip(expected).all(|(a, b)| same(b, a)), "{trial}: {corrected:?}");
        assert!(close(corrected.novelty, novelty), "{trial}");
        let doubted = [0, 1, 2, 3].map(|p| {
            let others: Vec<Gaussian<f64>> = (0..4).filter(|other| *other != p).map(|other| members[other]).collect();
            let (others, own) = (mixed(&others), members[p]);
            let unexplained = (own.mean - others.mean).powi(2) - own.variance - others.variance;
            Gaussian { mean: own.mean, variance: own.variance + unexplained.max(0.0) }
        });
        contradicted += usize::from(doubted != members);
        let Gaussian { mean, variance } = mixed(&doubted);
        let variance = 0.6 * variance + 0.06 * 0.7 * novelty;
        assert!(close(corrected.strain.mean, mean) && (corrected.strain.variance - variance).abs() < 1e-11, "{trial}");
    }
    assert!(contradicted > 5, "{contradicted}");
}

/// Features of twelve more rows, with the variance of the noise alone, heard beside what the others say together.
#[test]
fn simulated_rows_are_mixed_in_last() {
    const RELEVANCE: f64 = 0.07;
    let numbers = numbers();
    correction!(f64, numbers, [2, 3], rows, scales, weights, triangles, learned);
    let wider = numbers.scales.map(|scale| InputScale { lower: scale.lower - 0.5, upper: scale.upper + 0.2, ..scale });
    let process = Process {
        relevance: std::array::from_fn(|i| if i < 6 { 0.0 } else { RELEVANCE }),
        mean: 0.25,
        weights: &weights[1],
        explained: Triangle::NONE,
        variance: 0.0,
        noise: 0.08,
        widening: 1.0,
        least_variance: 0.0,
    };
    let with = Correction {
        simulated: Some(Simulated { rows: InputRows::new(&rows, ROWS), scales: &wider, process }),
        ..learned
    };
    for trial in 0..50 {
        let input: [f64; D] = std::array::from_fn(|i| 3.0 * number(3000 + 10 * trial + i));
        let filtered = Gaussian { mean: input[0], variance: 0.05 };
        let inside: Vec<f64> = (0..D).map(|i| input[i].clamp(wider[i].lower, wider[i].upper)).collect();
        let x = |i: usize| (inside[i] - wider[i].mean) / wider[i].sd;
        let kernel = |row: &[f64; D]| {
            let square: f64 = (6..D).map(|i| (x(i) - row[i]).powi(2)).sum();
            (-RELEVANCE * square).exp() + 0.09 * (1.0 + x(6) * row[6])
        };
        let mean = 0.25 + numbers.rows.iter().zip(&weights[1]).map(|(row, weight)| weight * kernel(row)).sum::<f64>();
        let outside: f64 = (6..D).map(|i| ((input[i] - inside[i]) / wider[i].sd).powi(2)).sum();
        let expected = Gaussian { mean: mean.clamp(-2.0, 2.0), variance: 0.08 + 0.03 * 0.7 * outside };
        let (corrected, alone) = (with.correct(&input, filtered, 1.0), learned.correct(&input, filtered, 1.0));
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
        let simulated = corrected.simulated.unwrap();
        assert!(
            close(simulated.mean, expected.mean) && close(simulated.variance, expected.variance),
            "{trial}: {simulated:?}"
        );
        assert_eq!(corrected.strain, mixture([alone.strain, simulated]), "{trial}");
        // Innovations four times as large as stated: so is the variance of what has learned from the filter, up to that of a strain
        // anywhere within ±2.
        let Gaussian { mean, variance } = alone.strain;
        let less_sure = Gaussian { mean, variance: (4.0 * variance).min(16.0 / 12.0).max(variance) };
        let surprised = with.correct(&input, filtered, 4.0);
        let expected = mixture([less_sure, simulated]);
        assert!(close(surprised.strain.mean, expected.mean) && close(surprised.strain.variance, expected.variance));
        assert_eq!(
            (corrected.direct, corrected.residual, corrected.novelty),
            (alone.direct, alone.residual, alone.novelty)
        );
    }
}

#[test]
fn single_precision_says_the_same() {
    let numbers = numbers();
    correction!(f64, numbers, [], rows, scales, weights, triangles, wide);
    correction!(f32, numbers, [], rows_32, scales_32, weights_32, triangles_32, narrow);
    for trial in 0..50 {
        let input: [f64; D] = std::array::from_fn(|i| 3.0 * number(2000 + 10 * trial + i));
        let corrected = wide.correct(&input, Gaussian { mean: input[0], variance: 0.05 }, 1.0);
        let corrected_32 =
            narrow.correct(&input.map(|x| x as f32), Gaussian { mean: input[0] as f32, variance: 0.05 }, 1.0);
        // Squared distances reach 30, in which 2⁻²⁴ is 2e-6; a dozen rows add up.
        let close = |a: f32, b: f64| (f64::from(a) - b).abs() < 3e-5 * (1.0 + b.abs());
        assert!(close(corrected_32.strain.mean, corrected.strain.mean), "{trial}: {corrected:?} {corrected_32:?}");
        assert!(
            close(corrected_32.strain.variance, corrected.strain.variance),
            "{trial}: {corrected:?} {corrected_32:?}"
        );
    }
}

#[test]
fn a_mixture_of_any_scale() {
    let at = |mean: f64, variance: f64| Gaussian { mean, variance };
    // Equal variances: the middle, and the distance of both from it.
    assert_eq!(mixture([at(-1.0, 0.25), at(1.0, 0.25)]), at(0.0, 1.25));
    // 16 times the variance: a 64th of the weight.
    let mixed = mixture([at(0.0, 1.0), at(65.0, 16.0)]);
    assert!((mixed.mean - 1.0).abs() < 1e-14);
    for scale in [1e-30_f64, 1e30] {
        let scaled = mixture([at(0.0, scale * scale), at(65.0 * scale, 16.0 * scale * scale)]);
        assert!(
            (scaled.mean / scale - 1.0).abs() < 1e-12
                && (scaled.variance / (scale * scale) / mixed.variance - 1.0).abs() < 1e-12
        );
    }
    // Exact knowledge drowns the rest.
    assert_eq!(mixture([at(0.3, 0.0), at(0.5, 1.0)]), at(0.3, 0.0));
    assert_eq!(mixture([at(0.5, 1.0), at(0.3, 0.0)]), at(0.3, 0.0));
}

#[test]
fn a_member_that_contradicts_all_others_has_less_weight() {
    let at = |mean: f64, variance: f64| Gaussian { mean, variance };
    // Three at 0 say 0 with a variance of 1: of 100, the square of the distance to the fourth, 98 are left. Two at 0 and the one at 10
    // say 10/3 with a variance of 1 + 200/9, which explains the 100/9 to the third.
    let result = consensus(at(0.0, 1.0), at(0.0, 1.0), [at(0.0, 1.0), at(10.0, 1.0)]);
    let weight = 99.0_f64.powf(-1.5);
    let mean = 10.0 * weight / (3.0 + weight);
    let second = (3.0 + weight * (99.0 + 100.0)) / (3.0 + weight);
    assert!(
        (result.mean - mean).abs() < 1e-14 && (result.variance - (second - mean * mean)).abs() < 1e-14,
        "{result:?}"
    );
    // Whichever it is.
    for (direct, residual) in [(10.0, 0.0), (0.0, 10.0)] {
        let permuted = consensus(at(direct, 1.0), at(residual, 1.0), [at(0.0, 1.0); 2]);
        assert!((permuted.mean - mean).abs() < 1e-14, "{permuted:?}");
    }
    // What their variances explain is no contradiction.
    let near = [at(0.0, 1.0), at(1.0, 2.0), at(0.5, 0.5), at(-0.5, 1.5)];
    assert_eq!(consensus(near[0], near[1], [near[2], near[3]]), mixture(near));
    // Of two nobody knows which is wrong.
    assert_eq!(consensus(at(0.0, 1.0), at(10.0, 1.0), []), mixture([at(0.0, 1.0), at(10.0, 1.0)]));
}

#[test]
fn a_missing_reading_holds_the_features_and_the_next_one_is_taken_over_the_whole_gap() {
    let scale = FeatureScale { centre: 0.1, half_range: 0.5, rates: [0.01, 0.02], starts: settled() };
    let (mut gappy, mut known) = (ReadingFeatures::<f64>::new(scale), ReadingFeatures::<f64>::new(scale));
    assert_eq!(gappy.step(0.0, None), None);
    let first = gappy.step(0.4, Some(0.3));
    // Settled on the first reading: no distances, no rates.
    let mut expected = [0.0; FEATURES];
    expected[0] = (0.3 - 0.1) / 0.5;
    assert_eq!(first, Some(expected));
    assert_eq!(known.step(0.0, Some(0.3)), first);
    assert_eq!(gappy.step(0.7, None), first);
    assert_eq!(gappy.step(0.8, None), first);
    // The sum of 0.7, 0.8 and 0.5 is rounded.
    let (gappy, known) = (gappy.step(0.5, Some(0.5)).unwrap(), known.step(2.0, Some(0.5)).unwrap());
    assert!(gappy.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-14));
    assert!(known[1..].iter().all(|x| *x > 0.0) && known[5] < 1.0);
}

/// A spike leaves the features as they were, and a step that goes on surprising is seen after the first three rows.
#[test]
fn a_few_surprising_readings_are_passed_over() {
    let scale = FeatureScale { centre: 0.1, half_range: 0.5, rates: [0.01, 0.02], starts: settled() };
    let start = || {
        let mut features = ReadingFeatures::<f64>::new(scale);
        features.step(0.1, Some(0.2));
        features
    };
    let (mut features, mut plain) = (start(), start());
    let before = plain.step(0.0, None);
    for spike in 0..3 {
        assert_eq!(features.step_unless(true, 0.1, Some(5.0)), before, "{spike}");
        assert!(features.is_waiting());
    }
    // A missing row neither counts nor breaks the row of surprises.
    assert_eq!(features.step_unless(true, 0.1, None), before);
    let seen = features.step_unless(true, 0.1, Some(0.3));
    assert!(seen != before && !features.is_waiting());
    // As if nothing had come in between, over the whole time; the sum of 0.1 five times is rounded.
    let expected = plain.step(0.5, Some(0.3)).unwrap();
    assert!(seen.unwrap().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14));
    features.step_unless(false, 0.1, Some(0.3));
    let before = features.step(0.0, None);
    assert_eq!(features.step_unless(true, 0.1, Some(5.0)), before, "after one that does not surprise");
}

/// Rates as tanh of thrice their usual sizes, and a gross error as what is three half ranges away.
#[test]
fn features_are_bounded() {
    let scale = FeatureScale { centre: 0.1, half_range: 0.5, rates: [0.3, 0.7], starts: settled() };
    let after = |reading: f64| {
        let mut features = ReadingFeatures::new(scale);
        features.step_unless(false, 0.0, Some(0.2));
        let seen = features.step_unless(false, 0.4, Some(reading)).unwrap();
        (seen, features.low_passes())
    };
    let (seen, low) = after(0.45);
    assert_eq!(seen[5], (3.0 * (low[0] - low[1]) / 0.3).tanh());
    assert_eq!(seen[6], (3.0 * (low[2] - low[3]) / 0.7).tanh());
    assert_eq!(after(40.0), after(0.1 + 3.0 * 0.5));
    assert_eq!(after(-40.0), after(0.1 - 3.0 * 0.5));
    assert!(after(0.1 + 2.9 * 0.5) != after(40.0) && after(0.1 - 2.9 * 0.5) != after(-40.0));
}

/// The error of a start fades as exp(−t/τ) and nothing else changes, since low-passes are linear.
#[test]
fn low_passes_start_at_their_given_values_and_forget_them() {
    let starts: [[f64; 2]; 6] = std::array::from_fn(|i| [0.1 * i as f64, 0.9 - 0.1 * i as f64]);
    let scale = FeatureScale { centre: 0.1, half_range: 0.5, rates: [0.01, 0.02], starts };
    let (mut started, mut at_rest) =
        (ReadingFeatures::<f64>::new(scale), ReadingFeatures::<f64>::new(FeatureScale { starts: settled(), ..scale }));
    let first = (0.3 - 0.1) / 0.5;
    let off = starts.map(|[a, b]| a + b * first - first);
    let mut time_s = 0.0;
    for (dt_s, reading) in [(0.0, 0.3), (0.4, 0.5), (3.0, 0.2), (20.0, 0.4)] {
        time_s += dt_s;
        started.step(dt_s, Some(reading));
        at_rest.step(dt_s, Some(reading));
        for (i, tau_s) in ohmstrain_ekf::correction::TIME_CONSTANTS_S.into_iter().enumerate() {
            let expected = at_rest.low_passes()[i] + off[i] * (-time_s / tau_s).exp();
            assert!((started.low_passes()[i] - expected).abs() < 1e-14, "{time_s} s, τ = {tau_s} s");
        }
    }
}
