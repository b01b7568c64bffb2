use nalgebra::{DMatrix, DVector};
use ohmstrain_ekf::Gaussian;
use ohmstrain_model::StrainRange;

use super::criterion::Criterion;
use super::prepared::{Choosing, scale};
use super::{AllRows, Choices, Chosen, Examples, Prepared};
use crate::correction::gaussian_process::{GaussianProcess, Settings, TrainingSet};
use ohmstrain_sensor::correction::{OwnedCorrection, ProcessKind};

const D: usize = 8;
const LIMITS: StrainRange<f64> = StrainRange { lower: -10.0, upper: 10.0 };

/// Returns rows on wandering curves, no two of which agree in their inputs, with a filter whose error is smooth.
fn examples<const D: usize>(n: usize, dt_s: f64) -> (Vec<[f64; D]>, Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..n).map(|k| dt_s * k as f64).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| (0.21 * t).sin()).collect();
    let row = |(t, strain): (&f64, &f64)| -> [f64; D] {
        let wave = |i: usize| ((0.13 + 0.07 * i as f64) * t + i as f64).sin() * (1.0 + i as f64);
        std::array::from_fn(|i| if i == 0 { strain + 0.1 * (0.4 * t).cos() } else { wave(i) })
    };
    let inputs = time_s.iter().zip(&strain).map(row).collect();
    (inputs, strain, time_s)
}

/// Textbook equations: mean and variance of the latent function and the noise's variance, with targets in their own unit (Rasmussen &
/// Williams 2006, eqs 2.23 and 2.24), for the kernel and noise written out here.
struct Textbook {
    mean: f64,
    latent: f64,
    prior: f64,
    noise: f64,
}

fn standardised(rows: &[Vec<f64>], row: &[f64]) -> Vec<f64> {
    let n = rows.len() as f64;
    (0..row.len())
        .map(|i| {
            let mean = rows.iter().map(|row| row[i]).sum::<f64>() / n;
            let variance = rows.iter().map(|row| (row[i] - mean).powi(2)).sum::<f64>() / n;
            (row[i] - mean) / variance.sqrt()
        })
        .collect()
}

fn textbook(rows: &[Vec<f64>], targets: &[f64], time_s: &[f64], settings: &Settings, at: &[f64]) -> Textbook {
    let n = rows.len();
    let x: Vec<Vec<f64>> = rows.iter().map(|row| standardised(rows, row)).collect();
    let at = standardised(rows, at);
    let kernel = |a: &[f64], b: &[f64]| {
        let square: f64 = (0..a.len()).map(|i| ((a[i] - b[i]) / settings.lengths[i]).powi(2)).sum();
        (-square / 2.0).exp() + 0.09 * (1.0 + a[0] * b[0])
    };
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let correlated = settings.noise.powi(2) * (-(time_s[i] - time_s[j]).abs() / settings.noise_time_s).exp();
        let white = if i == j { 0.09 * settings.noise.powi(2) + 1e-6 } else { 0.0 };
        kernel(&x[i], &x[j]) + correlated + white
    });
    let inverse = covariance.try_inverse().unwrap();
    let mean = targets.iter().sum::<f64>() / n as f64;
    let y = DVector::from_iterator(n, targets.iter().map(|y| y - mean));
    let k = DVector::from_iterator(n, x.iter().map(|row| kernel(row, &at)));
    // Scale of the kernel, in the unit of the targets, that maximises the marginal likelihood.
    let scale = y.dot(&(&inverse * &y)) / n as f64;
    let prior = kernel(&at, &at);
    Textbook {
        mean: mean + k.dot(&(&inverse * &y)),
        latent: scale * (prior - k.dot(&(&inverse * &k))),
        prior: scale * prior,
        noise: scale * 1.09 * settings.noise.powi(2),
    }
}

/// Returns the running correction that processes learn from examples.
fn learned<const D: usize, const S: usize>(choices: &Choices, examples: Examples<D>) -> OwnedCorrection<f64, D, S> {
    let params = choices.learned::<D, S>(&Prepared::new(examples)).unwrap();
    OwnedCorrection::new(&params, examples.inputs, examples.limits)
}

/// Returns length scales around one value, no two alike.
fn lengths(around: f64, inputs: usize) -> Vec<f64> {
    (0..inputs).map(|i| around * (1.0 + 0.3 * (i as f64).sin())).collect()
}

#[test]
fn a_correction_says_what_the_textbook_says() {
    // As many rows as may be inducing, so the variance is exact.
    let (inputs, strain, time_s) = examples(40, 1.7);
    let examples =
        Examples { inputs: &inputs, strain: &strain, time_s: &time_s, limits: LIMITS, reference_sd: 0.0, all: None };
    let direct = Settings { lengths: vec![2.0, 3.0], noise: 0.1, noise_time_s: 2.0 };
    let residual = Settings { lengths: lengths(4.0, D), noise: 0.3, noise_time_s: 10.0 };
    let choices = Choices {
        sd_scale: 0.8,
        direct: Chosen { inputs: vec![6, 7], settings: direct.clone(), sd_scale: 1.5 },
        residual: Chosen { inputs: (0..D).collect(), settings: residual.clone(), sd_scale: 1.0 },
        one_sided: Vec::new(),
    };
    let correction: OwnedCorrection<f64, D> = learned(&choices, examples);
    let all: Vec<Vec<f64>> = inputs.iter().map(|row| row.to_vec()).collect();
    let features: Vec<Vec<f64>> = inputs.iter().map(|row| row[6..].to_vec()).collect();
    let residuals: Vec<f64> = inputs.iter().zip(&strain).map(|(row, strain)| strain - row[0]).collect();
    for k in 0..39 {
        // A point between two rows, within the range of all.
        let input: [f64; D] = std::array::from_fn(|i| 0.5 * (inputs[k][i] + inputs[k + 1][i]));
        let predicted = correction.correction().correct(&input, Gaussian { mean: input[0], variance: 0.0 }, 1.0);
        let least = |book: &Textbook, share: f64| {
            let variance =
                strain.iter().map(|x| x * x).sum::<f64>() / 40.0 - (strain.iter().sum::<f64>() / 40.0).powi(2);
            book.latent * (share * variance / book.prior).max(1.0)
        };
        // Condition numbers of 1e6, and the regularisation of the 40 kernels: 1e-8.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-6;
        let book = textbook(&features, &strain, &time_s, &direct, &input[6..]);
        assert!(close(predicted.direct.mean, book.mean), "{k}: {} {}", predicted.direct.mean, book.mean);
        assert!(close(predicted.direct.variance, 2.25 * (least(&book, 0.5) + book.noise)), "{k}");
        let book = textbook(&all, &residuals, &time_s, &residual, &input);
        assert!(close(predicted.residual.mean, input[0] + book.mean), "{k}");
        assert!(close(predicted.residual.variance, least(&book, 0.07) + book.noise), "{k}");
        assert!(close(1.0 - predicted.novelty, 1.0 - book.latent / book.prior), "{k}");
    }
}

/// Compares a one-sided process with the textbook's, on rows that have only that side.
#[test]
fn one_sided_processes_see_their_side_alone() {
    const BOTH: usize = 17;
    let (inputs, strain, time_s) = examples::<BOTH>(40, 1.7);
    let examples =
        Examples { inputs: &inputs, strain: &strain, time_s: &time_s, limits: LIMITS, reference_sd: 0.0, all: None };
    let [direct, residual, past, future] = [
        (ProcessKind::Direct, 4.0, 0.1),
        (ProcessKind::Residual, 4.0, 0.3),
        (ProcessKind::Past, 2.0, 0.1),
        (ProcessKind::Future, 8.0, 0.03),
    ]
    .map(|(kind, length, noise)| {
        let inputs = kind.places(BOTH);
        let settings = Settings { lengths: lengths(length, inputs.len()), noise, noise_time_s: 2.0 };
        Chosen { inputs, settings, sd_scale: 1.0 }
    });
    let choices = Choices { sd_scale: 1.0, direct, residual, one_sided: vec![past.clone(), future.clone()] };
    let correction: OwnedCorrection<f64, BOTH, 2> = learned(&choices, examples);
    // Six outputs, the reading, six features of the past, four of the future, of which the last is the slowest.
    let of_past = |row: &[f64; BOTH]| row[6..13].to_vec();
    let of_future = |row: &[f64; BOTH]| vec![row[16], row[13], row[14], row[15]];
    let pasts: Vec<Vec<f64>> = inputs.iter().map(of_past).collect();
    let futures: Vec<Vec<f64>> = inputs.iter().map(of_future).collect();
    for k in 0..39 {
        let input: [f64; BOTH] = std::array::from_fn(|i| 0.5 * (inputs[k][i] + inputs[k + 1][i]));
        let predicted = correction.correction().correct(&input, Gaussian { mean: input[0], variance: 0.0 }, 1.0);
        let books = [
            textbook(&pasts, &strain, &time_s, &past.settings, &of_past(&input)),
            textbook(&futures, &strain, &time_s, &future.settings, &of_future(&input)),
        ];
        for (predicted, book) in predicted.one_sided.iter().zip(books) {
            assert!((predicted.mean - book.mean).abs() < 1e-6, "{k}: {} {}", predicted.mean, book.mean);
        }
    }
}

/// Tests inducing rows: with fewer of them the variance is larger, never smaller, and the mean is that with all.
#[test]
fn inducing_rows_cost_no_certainty_that_is_not_there() {
    let (inputs, strain, time_s) = examples(200, 1.7);
    let examples =
        Examples { inputs: &inputs, strain: &strain, time_s: &time_s, limits: LIMITS, reference_sd: 0.0, all: None };
    let chosen = |kind: ProcessKind| {
        let inputs = kind.places(D);
        let settings = Settings { lengths: vec![4.0; inputs.len()], noise: 0.1, noise_time_s: 2.0 };
        Chosen { inputs, settings, sd_scale: 1.0 }
    };
    let (direct, residual) = (chosen(ProcessKind::Direct), chosen(ProcessKind::Residual));
    let settings = residual.settings.clone();
    let choices = Choices { sd_scale: 1.0, direct, residual, one_sided: Vec::new() };
    let correction: OwnedCorrection<f64, D> = learned(&choices, examples);
    let all: Vec<Vec<f64>> = inputs.iter().map(|row| row.to_vec()).collect();
    let residuals: Vec<f64> = inputs.iter().zip(&strain).map(|(row, strain)| strain - row[0]).collect();
    for k in (0..199).step_by(7) {
        let input: [f64; D] = std::array::from_fn(|i| 0.5 * (inputs[k][i] + inputs[k + 1][i]));
        let predicted = correction.correction().correct(&input, Gaussian { mean: input[0], variance: 0.0 }, 1.0);
        let book = textbook(&all, &residuals, &time_s, &settings, &input);
        assert!((predicted.residual.mean - input[0] - book.mean).abs() < 1e-6, "{k}");
        assert!(predicted.novelty > book.latent / book.prior - 1e-6, "{k}");
    }
}

/// Tests length scales: the rows are independent, and the target depends on the first and the third of eight inputs. The third gets the
/// shortest length scale, and held-out rows are predicted better than with any common length scale.
#[test]
fn inputs_that_tell_nothing_get_long_length_scales() {
    const SETTINGS: Settings = Settings { lengths: Vec::new(), noise: 0.03, noise_time_s: 2.0 };
    let number = |seed: usize| ((seed as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0);
    let all: Vec<Vec<f64>> = (0..160).map(|k| (0..D).map(|i| number(17 * k + i + 1)).collect()).collect();
    let rows: Vec<Vec<f64>> = all.iter().map(|row| standardised(&all, row)).collect();
    let target: Vec<f64> = rows.iter().map(|x| (1.5 * x[2]).sin() + 0.5 * x[0]).collect();
    let time_s: Vec<f64> = (0..160).map(|k| 100.0 * f64::from(k)).collect();
    let (learned, others) = (0..100, 100..160);
    let inputs: Vec<&[f64]> = rows[learned.clone()].iter().map(Vec::as_slice).collect();
    let (targets, times) = (&target[learned.clone()], &time_s[learned.clone()]);
    let training = TrainingSet { inputs: &inputs, targets, time_s: times };
    let error = |settings: Settings| -> f64 {
        let of = |k: usize| textbook(&rows[learned.clone()], targets, times, &settings, &rows[k]).mean - target[k];
        others.clone().map(|k| of(k).powi(2)).sum()
    };
    let alike = |length: f64| error(Settings { lengths: vec![length; D], ..SETTINGS });
    let best_alike = [1.0, 2.0, 4.0, 8.0].map(alike).into_iter().fold(f64::INFINITY, f64::min);
    for criterion in [Criterion::LeftOutAndEvidence, Criterion::LeftOut] {
        let found = training.best_settings(criterion).unwrap();
        let tells_most = |(i, length): (usize, &f64)| i == 0 || i == 2 || *length > found.lengths[2];
        assert!(found.lengths.iter().enumerate().all(tells_most), "{criterion:?}: {:?}", found.lengths);
        let relevant = error(found);
        assert!(relevant < 0.25 * best_alike, "{criterion:?}: {relevant} {best_alike}");
    }
}

/// Compares the closed form of a process without a block to a process that was never given the block, apart from centre and scale.
#[test]
fn blocks_left_out_are_predicted_from_the_others() {
    let (inputs, strain, time_s) = examples::<D>(50, 1.7);
    let rows: Vec<&[f64]> = inputs.iter().map(|row| row.as_slice()).collect();
    let settings = Settings { lengths: vec![4.0; D], noise: 0.1, noise_time_s: 2.0 };
    let process =
        GaussianProcess::new(TrainingSet { inputs: &rows, targets: &strain, time_s: &time_s }, &settings).unwrap();
    let left_out = process.left_out(5).unwrap();
    let kernel = |a: &[f64], b: &[f64]| {
        let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        (-square / 32.0).exp() + 0.09 * (1.0 + a[0] * b[0])
    };
    let noise = |i: usize, j: usize| {
        0.01 * (-(time_s[i] - time_s[j]).abs() / 2.0).exp() + if i == j { 0.0009 + 1e-6 } else { 0.0 }
    };
    let mean = strain.iter().sum::<f64>() / 50.0;
    for block in 0..5 {
        let others: Vec<usize> = (0..50).filter(|k| k / 10 != block).collect();
        let covariance = |i: usize, j: usize| kernel(&inputs[i], &inputs[j]) + noise(i, j);
        let inverse = DMatrix::from_fn(40, 40, |i, j| covariance(others[i], others[j])).try_inverse().unwrap();
        let y = DVector::from_iterator(40, others.iter().map(|&k| strain[k] - mean));
        for k in 10 * block..10 * block + 10 {
            // The row's noise is correlated with that of its neighbours, which is known.
            let known = DVector::from_iterator(40, others.iter().map(|&j| covariance(k, j)));
            let predicted = mean + known.dot(&(&inverse * &y));
            assert!((left_out[k].mean - predicted).abs() < 1e-6, "{k}");
            let variance = covariance(k, k) - known.dot(&(&inverse * &known));
            let unknown = ((variance - 0.0109 - 1e-6) / kernel(&inputs[k], &inputs[k])).clamp(0.0, 1.0);
            assert!((left_out[k].unknown - unknown).abs() < 1e-6, "{k}");
        }
    }
}

/// Minimises a function of one number with one minimum, between 1e-6 and 1e6 on a logarithmic scale.
fn least(of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (-6.0 * 10f64.ln(), 6.0 * 10f64.ln());
    while high - low > 1e-9 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if of(a.exp()) < of(b.exp()) { high = b } else { low = a }
    }
    of(low.exp())
}

/// Returns the negative logarithm of a normal density.
fn surprise(error: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let inverse = covariance.clone().try_inverse().unwrap();
    let logs = covariance.determinant().ln() + error.len() as f64 * std::f64::consts::TAU.ln();
    0.5 * (error.dot(&(inverse * error)) + logs)
}

/// Costs of two settings differ by the negative log densities summed over held-out blocks. They are predicted by a process that was never
/// given these blocks, with the prior variance that minimises the sum.
#[test]
fn settings_are_judged_by_evidence_and_by_what_was_left_out() {
    const ROWS: usize = 23;
    let (inputs, strain, time_s) = examples::<D>(ROWS, 1.7);
    let rows: Vec<&[f64]> = inputs.iter().map(|row| row.as_slice()).collect();
    let training = TrainingSet { inputs: &rows, targets: &strain, time_s: &time_s };
    let mean = strain.iter().sum::<f64>() / ROWS as f64;
    let sd = (strain.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / ROWS as f64).sqrt();
    let y = DVector::from_iterator(ROWS, strain.iter().map(|y| (y - mean) / sd));
    let naive = |settings: &Settings| -> [f64; 2] {
        let covariance = DMatrix::from_fn(ROWS, ROWS, |i, j| {
            let square: f64 = (0..D).map(|k| ((inputs[i][k] - inputs[j][k]) / settings.lengths[k]).powi(2)).sum();
            let correlated = (-(time_s[i] - time_s[j]).abs() / settings.noise_time_s).exp();
            let white = if i == j { 0.09 * settings.noise.powi(2) + 1e-6 } else { 0.0 };
            (-square / 2.0).exp()
                + 0.09 * (1.0 + inputs[i][0] * inputs[j][0])
                + settings.noise.powi(2) * correlated
                + white
        });
        // Five blocks of 23 rows begin at 0, 4, 9, 13 and 18.
        let predicted = [0..4, 4..9, 9..13, 13..18, 18..23].map(|block| {
            let (own, others): (Vec<usize>, Vec<usize>) = (0..ROWS).partition(|k| block.contains(k));
            let between = |a: &[usize], b: &[usize]| covariance.select_rows(a).select_columns(b);
            let known = between(&others, &others).try_inverse().unwrap();
            let error = y.select_rows(&own) - between(&own, &others) * &known * y.select_rows(&others);
            (error, between(&own, &own) - between(&own, &others) * &known * between(&others, &own))
        });
        let blocks = |scale: f64| predicted.iter().map(|(error, left)| surprise(error, &(left * scale))).sum::<f64>();
        let row =
            |error: f64, variance: f64| 0.5 * (error * error / variance + (std::f64::consts::TAU * variance).ln());
        let rows = |scale: f64| -> f64 {
            let of = |(error, left): &(DVector<f64>, DMatrix<f64>)| {
                (0..error.len()).map(|k| row(error[k], scale * left[(k, k)])).sum::<f64>()
            };
            predicted.iter().map(of).sum()
        };
        let evidence = least(|scale| surprise(&y, &(&covariance * scale)));
        let left_out = least(rows);
        [(evidence + least(blocks) + left_out) / 3.0, left_out]
    };
    let settings = [(4.0, 0.1, 2.0), (3.0, 0.3, 10.0)].map(|(around, noise, noise_time_s)| Settings {
        lengths: lengths(around, D),
        noise,
        noise_time_s,
    });
    let expected = settings.each_ref().map(naive);
    for (place, criterion) in [Criterion::LeftOutAndEvidence, Criterion::LeftOut].into_iter().enumerate() {
        let cost = |of: &Settings| criterion.cost(&GaussianProcess::new(training, of).unwrap()).unwrap();
        let differ = cost(&settings[0]) - cost(&settings[1]);
        // Condition numbers of 1e5, and a minimum found where the function is flat to the last digit.
        assert!(
            (differ - (expected[0][place] - expected[1][place])).abs() < 1e-7,
            "{criterion:?}: {differ} {expected:?}"
        );
    }
}

/// Tests the factors: in the last fifth of the rows three of eight are off. The factor that covers the worst block covers 31 of its 32
/// rows (the 95 % quantile by rank), the one that covers all together 153 of 160.
#[test]
fn a_factor_covers_the_worst_block_or_all_together() {
    let (inputs, strain, time_s) = examples::<D>(160, 0.5);
    let off = |k: usize| if k >= 128 && k % 8 < 3 { 0.5 + 0.01 * k as f64 } else { 0.0 };
    let strain: Vec<f64> = strain.iter().enumerate().map(|(k, y)| y + off(k)).collect();
    let prepared = Prepared::new(Examples {
        inputs: &inputs,
        strain: &strain,
        time_s: &time_s,
        limits: LIMITS,
        reference_sd: 0.0,
        all: None,
    });
    let covered = |covers_worst: bool| {
        let by = Choosing { criterion: Criterion::LeftOut, covers_worst };
        let params = prepared.chosen(ProcessKind::Residual, by).unwrap();
        let predicted = prepared.left_out(ProcessKind::Residual, &params).unwrap();
        // The factor is at neither of its limits.
        assert!(params.sd_scale > 1.01 && params.sd_scale < 2.99, "{}", params.sd_scale);
        let is_covered = |k: &usize| (predicted[*k].mean - strain[*k]).abs() <= 1.959964 * predicted[*k].sd();
        [0, 1, 2, 3, 4].map(|block| (32 * block..32 * (block + 1)).filter(is_covered).count())
    };
    let worst = covered(true);
    assert_eq!(worst.into_iter().min(), Some(31), "{worst:?}");
    let together = covered(false);
    assert_eq!(together.into_iter().sum::<usize>(), 153, "{together:?}");
}

/// Tests learning: the correction is better than the filter on rows between the training rows; far from them the estimate remains the
/// filter's, with a wide interval.
#[test]
fn learning_helps_near_and_leaves_far_alone() {
    let (inputs, strain, time_s) = examples(160, 0.5);
    let even = |k: &usize| k.is_multiple_of(2);
    let pick = |values: &[f64]| (0..160).filter(even).map(|k| values[k]).collect::<Vec<f64>>();
    let seen: Vec<[f64; D]> = (0..160).filter(even).map(|k| inputs[k]).collect();
    let (known, times) = (pick(&strain), pick(&time_s));
    let examples =
        Examples { inputs: &seen, strain: &known, time_s: &times, limits: LIMITS, reference_sd: 0.0, all: None };
    let choices = Choices::fit::<D, 0>(&Prepared::new(examples), &[]).unwrap();
    let correction: OwnedCorrection<f64, D> = learned(&choices, examples);
    let (mut before, mut after, mut covered) = (0.0, 0.0, 0);
    for k in (1..160).step_by(2) {
        let filtered = Gaussian { mean: inputs[k][0], variance: 0.01 };
        let predicted = correction.correction().correct(&inputs[k], filtered, 1.0).strain;
        before += (inputs[k][0] - strain[k]).powi(2);
        after += (predicted.mean - strain[k]).powi(2);
        covered += u32::from((predicted.mean - strain[k]).abs() <= 1.96 * predicted.sd());
    }
    // The error of the filter is a function of the inputs, without noise.
    assert!(after < 0.04 * before, "{after} {before}");
    assert!(covered >= 72, "{covered} of 80");
    let mut far = inputs[80].map(|x| x + 100.0);
    far[0] = 0.3;
    let predicted = correction.correction().correct(&far, Gaussian { mean: 0.3, variance: 0.01 }, 1.0);
    assert!(predicted.novelty > 0.99);
    // The strain has a standard deviation of 0.7; at least six per cent of its variance is allowed for.
    assert!(predicted.strain.sd() > 0.17, "{}", predicted.strain.sd());
}

/// Returns three recordings of the same function, each with its own offset; `few` of their rows represent all.
fn recordings(few: usize) -> (Vec<[f64; D]>, Vec<f64>, Vec<[f64; D]>) {
    let number = |seed: usize| 2.0 * ((seed as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0;
    let inputs: Vec<[f64; D]> = (0..90).map(|k| std::array::from_fn(|i| 1.7 * number(31 * k + i))).collect();
    let strain =
        (0..90).map(|k| (0.8 * inputs[k][6]).tanh() + 0.3 * inputs[k][7] + [0.2, -0.1, 0.05][k / 30]).collect();
    let chosen = (0..few).map(|k| inputs[k * 90 / few]).collect();
    (inputs, strain, chosen)
}

/// Compares with normal equations written out: Bayesian regression on kernels of the few rows and an indicator of each recording. The prior
/// covariance of the weights is the inverse of the kernels; offsets have a standard deviation of a quarter of the targets'. Rows half a
/// second apart with a correlation time of four seconds count for a sixteenth each.
#[test]
fn a_few_rows_learn_what_all_recordings_say() {
    let (inputs, strain, few) = recordings(12);
    let recordings = [0..30, 30..60, 60..90];
    let scales: [_; D] = std::array::from_fn(|i| scale(few.iter().map(|row| row[i])));
    let z = |row: &[f64; D]| [6, 7].map(|i| (row[i] - scales[i].mean) / scales[i].sd);
    let lengths = [2.0, 3.0];
    let kernel = |a: [f64; 2], b: [f64; 2]| {
        let square: f64 = (0..2).map(|i| ((a[i] - b[i]) / lengths[i]).powi(2)).sum();
        (-0.5 * square).exp() + 0.09 * (1.0 + a[0] * b[0])
    };
    let mean = strain.iter().sum::<f64>() / 90.0;
    let size = (strain.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 90.0).sqrt();
    let (noise, share) = (0.3, 1.0 / 16.0);
    let white = 1.09 * noise * noise;
    let regular = DMatrix::from_fn(15, 15, |i, j| match (i < 12, j < 12) {
        (true, true) => kernel(z(&few[i]), z(&few[j])) + if i == j { 1e-6 } else { 0.0 },
        _ => {
            if i == j {
                16.0
            } else {
                0.0
            }
        }
    });
    // Rows of some recordings: posterior mean and covariance of weights and offsets, for a noise variance of 1.
    let posterior = |of: &[usize]| {
        let rows: Vec<usize> = of.iter().flat_map(|g| recordings[*g].clone()).collect();
        let design = DMatrix::from_fn(rows.len(), 15, |k, j| {
            if j < 12 { kernel(z(&inputs[rows[k]]), z(&few[j])) } else { f64::from(u8::from(rows[k] / 30 == j - 12)) }
        });
        let y = DVector::from_iterator(rows.len(), rows.iter().map(|k| (strain[*k] - mean) / size));
        let precision = design.transpose() * &design * (share / white) + &regular;
        let covariance = precision.try_inverse().unwrap();
        (&covariance * design.transpose() * y * (share / white), covariance)
    };
    let examples = Examples {
        inputs: &few,
        strain: &strain[..12],
        time_s: &[0.0; 12],
        limits: LIMITS,
        reference_sd: 0.0,
        all: Some(AllRows { inputs: &inputs, strain: &strain, recordings: &recordings, step_s: 0.5 }),
    };
    let prepared = Prepared::new(examples);
    let settings = Settings { lengths: lengths.to_vec(), noise, noise_time_s: 4.0 };
    let chosen = Chosen { inputs: vec![6, 7], settings, sd_scale: 1.0 };
    let direct = prepared.conditioned(ProcessKind::Direct, &chosen).unwrap();
    let (weights, _) = posterior(&[0, 1, 2]);
    for row in &inputs {
        let kernels = DVector::from_fn(12, |j, _| kernel(z(row), z(&few[j])));
        let found: f64 = kernels.iter().zip(&direct.weights).map(|(kernel, weight)| kernel * weight).sum();
        let expected = size * kernels.dot(&weights.rows(0, 12));
        // Kernels that are nearly alike determine only the sum of their weights; the equations are regularised by 1e-9.
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
    let predicted = prepared.left_out(ProcessKind::Direct, &chosen).unwrap();
    for (g, others) in [[1, 2], [0, 2], [0, 1]].iter().enumerate() {
        let (weights, covariance) = posterior(others);
        for k in recordings[g].clone() {
            let of_row = DVector::from_fn(15, |j, _| if j < 12 { kernel(z(&inputs[k]), z(&few[j])) } else { 0.0 });
            let expected = mean + size * of_row.dot(&weights);
            assert!((predicted[k].mean - expected).abs() < 1e-5, "{k}: {} {expected}", predicted[k].mean);
            // A row far from the few stays unknown: the variance that no kernel explains is added.
            let kernels = of_row.rows(0, 12).into_owned();
            let among = regular.view((0, 0), (12, 12)).into_owned().try_inverse().unwrap();
            let prior = kernel(z(&inputs[k]), z(&inputs[k]));
            let latent = prior - kernels.dot(&(among * &kernels)) + of_row.dot(&(&covariance * &of_row));
            let unknown = (latent / prior).clamp(0.0, 1.0);
            let least = 0.5
                * (strain[..12].iter().map(|x| x * x).sum::<f64>() / 12.0
                    - (strain[..12].iter().sum::<f64>() / 12.0).powi(2));
            let expected = unknown * (prior * direct.variance).max(least) + direct.noise;
            assert!((predicted[k].variance - expected).abs() < 1e-5, "{k}: {} {expected}", predicted[k].variance);
        }
    }
}
