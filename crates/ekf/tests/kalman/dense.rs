//! The joint normal distribution of all states of a linear model, conditioned on all readings at once: no recursion, no
//! factor, nothing of the crate.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// A row: `x′ = F x + push + w`, `y = H x + v`.
#[derive(Clone, Copy, Debug)]
pub struct Row<const N: usize, const M: usize> {
    pub transition: SMatrix<f64, N, N>,
    pub push: SVector<f64, N>,
    pub process_noise: SMatrix<f64, N, N>,
    pub gradient: SMatrix<f64, M, N>,
    pub reading_noise: SMatrix<f64, M, M>,
    pub reading: [Option<f64>; M],
}

/// Mean and covariance of each row's state given all readings, and the log density of these.
pub type Conditioned<const N: usize> = (Vec<(SVector<f64, N>, SMatrix<f64, N, N>)>, f64);

pub fn condition<const N: usize, const M: usize>(
    start: (SVector<f64, N>, SMatrix<f64, N, N>),
    rows: &[Row<N, M>],
) -> Conditioned<N> {
    let size = N * rows.len();
    let (mut mean, mut joint) = (DVector::zeros(size), DMatrix::zeros(size, size));
    let (mut m, mut p) = start;
    for (k, row) in rows.iter().enumerate() {
        m = row.transition * m + row.push;
        p = row.transition * p * row.transition.transpose() + row.process_noise;
        mean.rows_mut(N * k, N).copy_from(&m);
        let mut cross = p;
        for later in k..rows.len() {
            if later > k {
                cross *= rows[later].transition.transpose();
            }
            joint.view_mut((N * k, N * later), (N, N)).copy_from(&cross);
            joint.view_mut((N * later, N * k), (N, N)).copy_from(&cross.transpose());
        }
    }
    let seen: Vec<(usize, usize, f64)> =
        (0..rows.len()).flat_map(|k| (0..M).filter_map(move |i| rows[k].reading[i].map(|y| (k, i, y)))).collect();
    let h = DMatrix::from_fn(seen.len(), size, |row, column| {
        let (k, i, _) = seen[row];
        if column / N == k { rows[k].gradient[(i, column % N)] } else { 0.0 }
    });
    let r = DMatrix::from_fn(seen.len(), seen.len(), |a, b| {
        if seen[a].0 == seen[b].0 { rows[seen[a].0].reading_noise[(seen[a].1, seen[b].1)] } else { 0.0 }
    });
    let root = (&h * &joint * h.transpose() + r).cholesky().unwrap();
    let innovation = DVector::from_iterator(seen.len(), seen.iter().map(|(_, _, y)| *y)) - &h * &mean;
    let by_s = root.solve(&innovation);
    let ln_det: f64 = 2.0 * root.l().diagonal().iter().map(|x| x.ln()).sum::<f64>();
    let two_pi = seen.len() as f64 * std::f64::consts::TAU.ln();
    let log_density = -0.5 * (innovation.dot(&by_s) + ln_det + two_pi);
    let cross = &joint * h.transpose();
    let means = mean + &cross * by_s;
    let covariances = &joint - &cross * root.solve(&cross.transpose());
    let state = |k: usize| {
        let covariance = covariances.fixed_view::<N, N>(N * k, N * k).into_owned();
        (means.fixed_rows::<N>(N * k).into_owned(), covariance)
    };
    ((0..rows.len()).map(state).collect(), log_density)
}
