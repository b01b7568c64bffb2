//! Linear models: every number of filter, smoothers and likelihood beside the dense joint distribution.

use nalgebra::{SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, Normal, Rewind, Step, Ukf, smooth, smooth_first};
use proptest::prelude::*;

use super::dense::{Row, condition};

const N: usize = 3;
const M: usize = 2;
type Rows = Vec<Row<N, M>>;

/// 60 states in float64: sums of some thousand products of numbers of order ten, and S with a condition of 1e4.
const ROUNDING: f64 = 1e-9;

fn entries<const R: usize, const C: usize>(size: f64) -> impl Strategy<Value = SMatrix<f64, R, C>> {
    prop::collection::vec(-size..size, R * C).prop_map(SMatrix::from_iterator)
}

/// Another model in every row; process noise of rank two, correlated reading noise, each reading missing now and then.
fn rows() -> impl Strategy<Value = Rows> {
    let row = (
        entries::<3, 3>(0.3),
        entries::<3, 1>(1.0),
        entries::<3, 2>(0.5),
        entries::<2, 3>(1.0),
        entries::<2, 2>(0.5),
        prop::array::uniform2(prop::option::weighted(0.7, -2.0..2.0_f64)),
    );
    let row = row.prop_map(|(f, push, q, gradient, r, reading)| Row {
        transition: SMatrix::identity() * 0.7 + f,
        push,
        process_noise: q * q.transpose(),
        gradient,
        reading_noise: r * r.transpose() + SMatrix::identity() * 0.01,
        reading,
    });
    prop::collection::vec(row, 1..20)
}

fn start() -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    (vector![1.0, -1.0, 0.5], matrix![2.0, 0.5, 0.0; 0.5, 1.0, 0.0; 0.0, 0.0, 0.0])
}

fn kalman(row: &Row<N, M>) -> Kalman<f64, N, M> {
    let Row { transition, process_noise, gradient, reading_noise, push, .. } = *row;
    Kalman { control: push, ..Kalman::new(transition, process_noise, gradient, reading_noise) }
}

fn filter(rows: &Rows) -> Vec<Step<f64, N, M>> {
    let mut state = Normal::new(start().0, &start().1).unwrap();
    let step = |row: &Row<N, M>| {
        let step = kalman(row).step(&state, &row.reading).unwrap();
        state = step.posterior;
        step
    };
    rows.iter().map(step).collect()
}

fn same(found: &Normal<f64, N>, mean: &SVector<f64, N>, covariance: &SMatrix<f64, N, N>) -> bool {
    (found.mean - mean).amax() < ROUNDING && (found.covariance() - covariance).amax() < ROUNDING
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn filter_smoothers_and_likelihood_are_the_joint_distributions(rows in rows(), lag in 0_usize..4) {
        let steps = filter(&rows);
        let mut sum = 0.0;
        for (k, step) in steps.iter().enumerate() {
            let (states, log_density) = condition(start(), &rows[..=k]);
            prop_assert!(same(&step.posterior, &states[k].0, &states[k].1), "{k}: {step:?} {states:?}");
            sum += step.log_likelihood;
            prop_assert!((sum - log_density).abs() < ROUNDING * (1.0 + log_density.abs()), "{k}: {sum} {log_density}");
            let mut blind = rows[..=k].to_vec();
            blind[k].reading = [None; M];
            let prior = &condition(start(), &blind).0[k];
            prop_assert!(same(&step.prior, &prior.0, &prior.1), "{k}");
        }
        let mut smoothed = vec![steps[0].posterior; steps.len()];
        smooth(&steps, &mut smoothed).unwrap();
        let (states, _) = condition(start(), &rows);
        for (k, (found, state)) in smoothed.iter().zip(&states).enumerate() {
            prop_assert!(same(found, &state.0, &state.1), "{k}");
        }
        for (k, window) in steps.windows(lag + 1).enumerate() {
            let state = &condition(start(), &rows[..=k + lag]).0[k];
            prop_assert!(same(&smooth_first(window).unwrap(), &state.0, &state.1), "{k}");
        }
    }

    /// The rest of what a step returns, by the textbook's formulas.
    #[test]
    fn innovation_gain_and_nis_are_the_textbooks(rows in rows()) {
        for (row, step) in rows.iter().zip(filter(&rows)) {
            let [Some(first), Some(second)] = row.reading else { continue };
            let (h, p) = (row.gradient, step.prior.covariance());
            let s = h * p * h.transpose() + row.reading_noise;
            let innovation = vector![first, second] - h * step.prior.mean;
            let inverse = s.try_inverse().unwrap();
            let gain = p * h.transpose() * inverse;
            prop_assert!((step.innovation - innovation).amax() < ROUNDING);
            prop_assert!((step.innovation_covariance - s).amax() < ROUNDING);
            prop_assert!((step.gain - gain).amax() < ROUNDING);
            prop_assert!((step.nis - innovation.dot(&(inverse * innovation))).abs() < ROUNDING * (1.0 + step.nis));
            prop_assert_eq!(step.readings, 2);
            prop_assert!((step.transition.slope - row.transition).amax() < ROUNDING);
            prop_assert!((step.transition.noise() - row.process_noise).amax() < ROUNDING);
        }
    }

    /// Iterated or unscented, a linear model is a linear model.
    #[test]
    fn other_filters_agree_on_linear_models(rows in rows()) {
        let mut state = Normal::new(start().0, &start().1).unwrap();
        for row in &rows {
            let own = kalman(row);
            let step = own.step(&state, &row.reading).unwrap();
            let iterated = own.update_iterated(&step.prior, &row.reading, 3).unwrap();
            prop_assert!(same(&iterated.posterior, &step.posterior.mean, &step.posterior.covariance()));
            let functions = (
                |x: &SVector<f64, N>| row.transition * x + row.push,
                |x: &SVector<f64, N>| row.gradient * x,
            );
            let unscented = Ukf::new(functions, row.process_noise, row.reading_noise).step(&state, &row.reading).unwrap();
            prop_assert!(same(&unscented.posterior, &step.posterior.mean, &step.posterior.covariance()));
            prop_assert!((unscented.log_likelihood - step.log_likelihood).abs() < ROUNDING * (1.0 + step.nis));
            state = step.posterior;
        }
    }

    /// Late readings give the same result in any order, as long as they are remembered.
    #[test]
    fn late_readings_are_as_good_as_punctual_ones(
        arrivals in prop::collection::vec((0.0..2.0_f64, -1.0..1.0_f64), 1..12),
    ) {
        let walk = |from_s: f64, to_s: f64| {
            let dt = to_s - from_s;
            let noise = matrix![dt.powi(3) / 3.0, dt.powi(2) / 2.0; dt.powi(2) / 2.0, dt];
            Kalman::new(matrix![1.0, dt; 0.0, 1.0], noise, matrix![1.0, 0.0], matrix![0.01])
        };
        let origin = Normal::independent(vector![0.0, 0.0], &vector![1.0, 1.0]).unwrap();
        let mut rewind = Rewind::<_, _, 2, 1, 12>::new(walk, 0.0, origin);
        for (time_s, y) in &arrivals {
            rewind.take(*time_s, [Some(*y)]).unwrap();
        }
        let mut sorted = arrivals;
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut state, mut before_s) = (origin, 0.0);
        for (time_s, y) in &sorted {
            state = walk(before_s, *time_s).step(&state, &[Some(*y)]).unwrap().posterior;
            before_s = *time_s;
        }
        let (time_s, found) = rewind.latest();
        prop_assert_eq!(time_s, before_s);
        prop_assert!((found.mean - state.mean).amax() < 1e-12 && (found.covariance() - state.covariance()).amax() < 1e-12);
    }
}

/// Forgotten readings cannot be taken again; until then nothing is lost, whether the late reading itself is forgotten or not.
#[test]
fn a_full_memory_forgets_the_oldest() {
    let walk = |from_s: f64, to_s: f64| Kalman::new(matrix![1.0], matrix![to_s - from_s], matrix![1.0], matrix![0.5]);
    let start = Normal::independent(vector![0.0], &vector![1.0]).unwrap();
    let readings: [(f64, f64); 6] = [(1.0, 0.3), (2.0, 0.1), (3.0, -0.4), (4.0, 0.2), (1.5, 0.6), (3.5, 0.1)];
    let in_order = |last: usize| {
        let mut sorted = readings[..last].to_vec();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let begin = (0.0, start);
        sorted
            .iter()
            .fold(begin, |(from_s, x), (t, y)| (*t, walk(from_s, *t).step(&x, &[Some(*y)]).unwrap().posterior))
            .1
    };
    // Three are remembered: the reading of 1.5 s goes before all of them, and is the last that can.
    let mut rewind = Rewind::<_, _, 1, 1, 3>::new(walk, 0.0, start);
    for (k, (time_s, y)) in readings.iter().enumerate() {
        let found = rewind.take(*time_s, [Some(*y)]).unwrap();
        assert!((found.mean - in_order(k + 1).mean).amax() < 1e-15, "{time_s} {found:?}");
    }
    let before = rewind.latest();
    assert_eq!(rewind.take(1.4, [Some(0.0)]), Err(KalmanError::TimeOutOfReach));
    assert_eq!(rewind.take(f64::NAN, [Some(0.0)]), Err(KalmanError::TimeOutOfReach));
    assert_eq!(rewind.take(4.5, [Some(f64::NAN)]), Err(KalmanError::NonFiniteReading));
    assert_eq!(rewind.latest(), before);
}
