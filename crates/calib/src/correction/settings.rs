//! The search for the settings of a process.

use nalgebra::DMatrix;

use super::criterion::Criterion;
use ohmstrain_sensor::correction::relevance;

use super::gaussian_process::{GaussianProcess, Noise, Settings, TrainingSet, lower_triangle};

/// Length scales, common to all inputs, noises and correlation times tried. The grid is coarse: a few hundred rows with correlated errors
/// determine no more.
const LENGTHS: [f64; 3] = [2.0, 4.0, 8.0];
const NOISES: [f64; 3] = [0.03, 0.1, 0.3];
const NOISE_TIMES_S: [f64; 2] = [2.0, 10.0];
/// Factor between the length scales tried for one input, and number of passes over the inputs. After the common length scale, each input in
/// turn gets its own, except the first, on which the linear part of the kernel depends.
const STRETCH: f64 = 2.0;
const TURNS: usize = 2;
/// Prior of a length scale relative to the common one: log-normal, with this factor as a standard deviation; and its limits.
const SPREAD: f64 = 2.0;
const LEAST_STRETCH: f64 = 0.25;
const MOST_STRETCH: f64 = 8.0;

impl TrainingSet<'_> {
    /// Returns the settings that maximise the criterion times the prior of the length scales; `None` if no covariance is positive definite.
    pub(crate) fn best_settings(self, criterion: Criterion) -> Option<Settings> {
        self.alike(criterion).map(|(cost, params)| self.with_relevance(criterion, cost, params))
    }

    /// Chooses the settings with one length scale for all inputs.
    fn alike(self, criterion: Criterion) -> Option<(f64, Settings)> {
        let inputs = self.inputs.first()?.len();
        let squares = self.half_squares(&vec![1.0; inputs]);
        let noises = NOISES.into_iter().flat_map(|noise| NOISE_TIMES_S.map(|time_s| Noise::new(self, noise, time_s)));
        let noises: Vec<Noise> = noises.collect();
        let mut best: Option<(f64, f64, &Noise)> = None;
        for length in LENGTHS {
            let kernel = self.kernel(&(&squares / (length * length)));
            for noise in &noises {
                let Some(cost) = self.cost(criterion, kernel.clone(), noise) else { continue };
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, length, noise));
                }
            }
        }
        best.map(|(cost, length, Noise { sd, time_s, .. })| {
            (cost, Settings { lengths: vec![length; inputs], noise: *sd, noise_time_s: *time_s })
        })
    }

    /// Determines the relevance of inputs automatically (Neal, *Bayesian Learning for Neural Networks*, 1996): inputs with little
    /// information get long length scales. One coordinate moves at a time; a few hundred rows cannot resolve more.
    fn with_relevance(self, criterion: Criterion, cost: f64, params: Settings) -> Settings {
        let inputs = params.lengths.len();
        let noise = Noise::new(self, params.noise, params.noise_time_s);
        let sums = self.half_squares(&params.lengths);
        let mut search = RelevanceSearch { training: self, criterion, noise, sums, params, cost };
        for input in (1..inputs).cycle().take(TURNS * (inputs - 1)) {
            // Shortens for as long as that helps; if it does not help at all, lengthens.
            let shorter = (0..).take_while(|_| search.step(input, 1.0 / STRETCH)).count();
            while shorter == 0 && search.step(input, STRETCH) {}
        }
        search.params
    }

    fn cost(self, criterion: Criterion, kernel: DMatrix<f64>, noise: &Noise) -> Option<f64> {
        criterion.cost(&GaussianProcess::of_kernel(self.targets, kernel, noise)?)
    }

    /// Returns the sums with another length scale of one input.
    fn stretched(self, sums: &DMatrix<f64>, input: usize, from: f64, to: f64) -> DMatrix<f64> {
        let change = relevance(to) - relevance(from);
        let apart = |i: usize, j: usize| self.inputs[i][input] - self.inputs[j][input];
        lower_triangle(self.inputs.len(), |i, j| sums[(i, j)] + change * apart(i, j).powi(2))
    }
}

/// State of the search for better settings.
struct RelevanceSearch<'a> {
    training: TrainingSet<'a>,
    criterion: Criterion,
    noise: Noise,
    params: Settings,
    /// `Σ (xᵢ - xᵢ')²/2ℓᵢ²` for all pairs of rows, in the lower triangle.
    sums: DMatrix<f64>,
    /// Negative logarithm of criterion and prior.
    cost: f64,
}

impl RelevanceSearch<'_> {
    /// Multiplies the length scale of an input, if that lowers the cost.
    fn step(&mut self, input: usize, factor: f64) -> bool {
        let (now, alike) = (self.params.lengths[input], self.params.lengths[0]);
        let trial = factor * now;
        if !(LEAST_STRETCH * alike..=MOST_STRETCH * alike).contains(&trial) {
            return false;
        }
        let sums = self.training.stretched(&self.sums, input, now, trial);
        self.params.lengths[input] = trial;
        let prior = |length: &f64| 0.5 * ((length / alike).ln() / SPREAD.ln()).powi(2);
        let priors: f64 = self.params.lengths.iter().map(prior).sum();
        let cost = self.training.cost(self.criterion, self.training.kernel(&sums), &self.noise);
        let cost = cost.map_or(f64::INFINITY, |cost| cost + priors);
        let is_better = cost < self.cost;
        if is_better {
            (self.cost, self.sums) = (cost, sums);
        } else {
            self.params.lengths[input] = now;
        }
        is_better
    }
}
