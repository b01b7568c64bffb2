use nalgebra::DVector;

use crate::samples::{Samples, central_rate, filled_strain};

/// The known strain of one recording as regressors of the law: with the time constants given, ρ is linear in all other
/// parameters.
///
/// Strain is scaled to `x = (ε - centre)/span` so that every column is of order one.
pub(crate) struct Regressors {
    time_s: Vec<f64>,
    strain: Vec<f64>,
    scaled: Vec<f64>,
    rate: Vec<f64>,
}

/// Number of columns of one branch: stretching and releasing, constant and proportional to strain.
pub(crate) const BRANCH_COLUMNS: usize = 4;

/// Centre and span of the strain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StrainScale {
    pub centre: f64,
    pub span: f64,
}

impl StrainScale {
    /// Returns the scale of the strains between two ends.
    pub(crate) fn of(lower: f64, upper: f64) -> Self {
        Self { centre: 0.5 * (lower + upper), span: upper - lower }
    }

    pub(crate) fn scaled(&self, strain: f64) -> f64 {
        (strain - self.centre) / self.span
    }
}

impl Regressors {
    pub(crate) fn new(samples: &Samples, scale: &StrainScale) -> Self {
        let strain = filled_strain(samples);
        let scaled: Vec<f64> = strain.iter().map(|&x| scale.scaled(x)).collect();
        let rate = central_rate(samples.time_s, &scaled);
        Self { time_s: samples.time_s.to_vec(), strain, scaled, rate }
    }

    /// Evaluates a function of the strain in every row.
    pub(crate) fn of_strain(&self, f: impl Fn(f64) -> f64) -> DVector<f64> {
        DVector::from_iterator(self.strain.len(), self.strain.iter().map(|&strain| f(strain)))
    }

    /// Returns the dash-pot columns: rate while stretching and while releasing, in spans per second.
    pub(crate) fn viscosity(&self) -> [DVector<f64>; 2] {
        let column = |pick: fn(f64) -> f64| DVector::from_iterator(self.rate.len(), self.rate.iter().map(|&v| pick(v)));
        [column(|v| v.max(0.0)), column(|v| v.min(0.0))]
    }

    /// Returns the four columns of a branch of unit gain with time constant `tau_s`: responses to stretching and to
    /// releasing, and both weighted with the scaled mid-strain. Exact for strain that is linear between rows.
    pub(crate) fn branch(&self, tau_s: f64) -> [DVector<f64>; BRANCH_COLUMNS] {
        let rows = self.time_s.len();
        let mut columns: [DVector<f64>; BRANCH_COLUMNS] = std::array::from_fn(|_| DVector::zeros(rows));
        let mut state = [0.0; BRANCH_COLUMNS];
        for k in 1..rows {
            let x = (self.time_s[k] - self.time_s[k - 1]) / tau_s;
            let (decay, mean_decay) = ((-x).exp(), -(-x).exp_m1() / x);
            let step = self.scaled[k] - self.scaled[k - 1];
            let middle = 0.5 * (self.scaled[k] + self.scaled[k - 1]);
            let (up, down) = (step.max(0.0), step.min(0.0));
            for (c, drive) in state.iter_mut().zip([up, down, up * middle, down * middle]) {
                *c = *c * decay + mean_decay * drive;
            }
            for (column, c) in columns.iter_mut().zip(state) {
                column[k] = c;
            }
        }
        columns
    }
}
