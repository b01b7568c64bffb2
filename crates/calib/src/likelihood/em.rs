use nalgebra::{Cholesky, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Ekf, Reading, Step, rts_smooth_vec};
use ohmstrain_model::Symmetric;

use super::LinearModel;
use crate::CalibrationError;

/// Where expectation maximisation starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmStart<const N: usize, const L: usize> {
    /// The model; its transition and gradient stay, its noise and variance are found.
    pub model: LinearModel<f64, N, L>,
    /// What is known before the first reading; it stays.
    pub belief: Belief<f64, N, L>,
}

/// One iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmIteration<const N: usize, const L: usize> {
    /// The model before it.
    pub model: LinearModel<f64, N, L>,
    /// Its log-likelihood, which no iteration lowers.
    pub log_likelihood: f64,
}

/// Q and R of a linear model by expectation maximisation: smooth, then take the mean squares of the smoothed noise and of
/// what the smoother leaves unexplained, uncertainty included. Returns `iterations + 1` models, the start first.
///
/// It needs no step length and no derivative and always climbs, slowly: a second opinion on a maximum that was found
/// otherwise, not a way to get there. `readings` are one step apart, NaN where missing; the first is an update without a
/// prediction.
///
/// Source: Shumway & Stoffer, *J. Time Ser. Anal.* 3 (1982) 253.
///
/// # Errors
/// If the filter fails, fewer than two rows or no reading are given, or a state is predicted exactly, which leaves its
/// noise nothing to be found from; the time in an error is the row's number.
pub fn expectation_maximisation<const N: usize, const L: usize>(
    start: &EmStart<N, L>,
    readings: &[f64],
    iterations: usize,
) -> Result<Vec<EmIteration<N, L>>, CalibrationError> {
    let seen = readings.iter().filter(|reading| !reading.is_nan()).count();
    if readings.len() < 2 || seen == 0 {
        return Err(CalibrationError::TooFewRows { recording: 0, complete: seen, needed: 2 });
    }
    let mut model = start.model;
    let mut trace = Vec::with_capacity(iterations + 1);
    loop {
        let steps = filter(&model, &start.belief, readings)?;
        let log_likelihood = steps.iter().filter_map(|step| step.update).map(|update| update.log_likelihood).sum();
        trace.push(EmIteration { model, log_likelihood });
        if trace.len() > iterations {
            return Ok(trace);
        }
        (model.noise, model.variance) = mean_squares(&model, &steps, readings)?;
    }
}

fn filter<const N: usize, const L: usize>(
    model: &LinearModel<f64, N, L>,
    start: &Belief<f64, N, L>,
    readings: &[f64],
) -> Result<Vec<Step<f64, N, L>>, CalibrationError> {
    let filter = Ekf::new(*model);
    let mut belief = *start;
    let mut steps = Vec::with_capacity(readings.len());
    for (row, value) in readings.iter().enumerate() {
        let dt_s = if row == 0 { 0.0 } else { 1.0 };
        let reading = (!value.is_nan()).then(|| Reading::from(*value));
        let failed = |error| CalibrationError::Filter { time_s: row as f64, error };
        let step = filter.step(&belief, dt_s, reading).map_err(failed)?;
        belief = step.posterior;
        steps.push(step);
    }
    Ok(steps)
}

/// Expected mean squares of process noise and reading noise given all readings.
#[allow(non_snake_case, reason = "F, G, H, P are the letters of every textbook; NOTATION.md has the table")]
fn mean_squares<const N: usize, const L: usize>(
    model: &LinearModel<f64, N, L>,
    steps: &[Step<f64, N, L>],
    readings: &[f64],
) -> Result<(Symmetric<f64, N, L>, f64), CalibrationError> {
    let smoothed = rts_smooth_vec(steps);
    let (F, H) = (model.transition, &model.gradient);
    let mut process = SMatrix::<f64, N, N>::zeros();
    for k in 0..steps.len() - 1 {
        let (now, next) = (&smoothed[k], &smoothed[k + 1]);
        let prior = Cholesky::new(steps[k + 1].prior.covariance.to_matrix()).ok_or(CalibrationError::Singular)?;
        // G = P Fᵀ (prior covariance)⁻¹, and the covariance Pˢ Gᵀ of the next state with this one.
        let G = prior.solve(&(F * steps[k].posterior.covariance.to_matrix())).transpose();
        let P_next = next.covariance.to_matrix();
        let lagged = P_next * G.transpose() * F.transpose();
        let noise: SVector<f64, N> = next.mean - F * now.mean;
        process += noise * noise.transpose() + P_next - lagged - lagged.transpose()
            + F * now.covariance.to_matrix() * F.transpose();
    }
    let (mut reading_noise, mut seen) = (0.0, 0.0);
    for (belief, reading) in smoothed.iter().zip(readings).filter(|(_, reading)| !reading.is_nan()) {
        reading_noise += (reading - H.dot(&belief.mean)).powi(2) + H.dot(&belief.covariance.mul(H));
        seen += 1.0;
    }
    Ok((Symmetric::from_lower(&(process / (steps.len() - 1) as f64)), reading_noise / seen))
}
