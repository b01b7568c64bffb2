use crate::design::central_rate;
use crate::samples::{Samples, filled_strain};

/// How the strain of the recordings moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotionStats {
    pub strain_mean: f64,
    pub strain_sd: f64,
    pub rate_sd: f64,
    /// Time after which the rate's autocorrelation has fallen to 1/e.
    pub rate_time_s: f64,
    /// 99th percentile of the speed.
    pub fastest_rate: f64,
    pub longest_s: f64,
}

/// Rows over which a rate is averaged, to each side: references are quantised and a difference of neighbours shows that
/// before anything else.
const HALF_WINDOW: usize = 2;

impl MotionStats {
    pub(crate) fn new(recordings: &[Samples]) -> Self {
        let (mut strains, mut rates) = (Vec::new(), Vec::new());
        let mut times = Vec::new();
        let mut longest_s = 0.0_f64;
        for samples in recordings {
            let strain = filled_strain(samples);
            let rate = moving_mean(&central_rate(samples.time_s, &strain));
            times.push(correlation_time(samples.time_s, &rate));
            rates.extend(rate);
            strains.extend(strain);
            longest_s = longest_s.max(samples.time_s[samples.len() - 1] - samples.time_s[0]);
        }
        let strain_mean = mean(&strains);
        let deviations: Vec<f64> = strains.iter().map(|x| x - strain_mean).collect();
        let mut speeds: Vec<f64> = rates.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        Self {
            strain_mean,
            strain_sd: root_mean_square(&deviations),
            rate_sd: root_mean_square(&rates),
            rate_time_s: mean(&times),
            fastest_rate: speeds[(speeds.len() - 1) * 99 / 100],
            longest_s,
        }
    }
}

/// Time at which the autocorrelation crosses 1/e, at most half the recording.
fn correlation_time(time_s: &[f64], x: &[f64]) -> f64 {
    let rows = x.len();
    let interval = (time_s[rows - 1] - time_s[0]) / (rows - 1) as f64;
    let power: f64 = x.iter().map(|v| v * v).sum();
    let lag = (1..rows / 2).find(|&lag| {
        let product: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum();
        product < power / std::f64::consts::E
    });
    lag.unwrap_or(rows / 2) as f64 * interval
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

pub(crate) fn root_mean_square(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

fn moving_mean(x: &[f64]) -> Vec<f64> {
    (0..x.len()).map(|k| mean(&x[k.saturating_sub(HALF_WINDOW)..(k + HALF_WINDOW + 1).min(x.len())])).collect()
}
