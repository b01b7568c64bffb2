use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{
    BLOCK, Correction, FILTER_INPUTS, INDUCING, InputRows, InputScale, Process, RowBlock, Simulated, Triangle,
    block_of, stripes,
};
use ohmstrain_model::StrainRange;

use crate::Filter;

/// Numbers of training rows and of simulated rows that `calibrate` keeps.
const ROWS: usize = 200;
const SIMULATED: usize = 64;

/// A filter with the default learned correction. Its numbers are made up, since the cost does not depend on them.
#[derive(Clone, Debug)]
pub struct Corrected {
    rows: Vec<RowBlock<f64, FILTER_INPUTS>>,
    scales: [InputScale<f64>; FILTER_INPUTS],
    weights: Vec<f64>,
    explained: Vec<[f64; BLOCK]>,
    strain: f64,
}

impl Corrected {
    /// Creates the correction before any reading.
    #[must_use]
    pub fn new() -> Self {
        let number = |k: usize| (0.37 * k as f64).sin() + 0.5 * (1.93 * k as f64).sin();
        let rows: Vec<[f64; FILTER_INPUTS]> = (0..ROWS).map(|k| std::array::from_fn(|i| number(29 * k + i))).collect();
        Self {
            rows: rows.chunks(BLOCK).filter_map(block_of).collect(),
            scales: [InputScale { mean: 0.1, sd: 0.8, lower: -1.0, upper: 1.2 }; FILTER_INPUTS],
            weights: (0..ROWS).map(|k| 0.01 * number(7 * k)).collect(),
            explained: stripes(INDUCING, |i, j| 0.02 * number(3 * (INDUCING * i + j))).collect(),
            strain: 0.0,
        }
    }

    fn process(&self, length: f64) -> Process<'_, f64, FILTER_INPUTS> {
        Process {
            relevance: std::array::from_fn(|i| (1.0 + 0.05 * i as f64) / (length * length)),
            mean: 0.1,
            weights: &self.weights,
            explained: Triangle::new(&self.explained, INDUCING),
            variance: 0.4,
            noise: 0.01,
            widening: 1.2,
            least_variance: 0.3,
        }
    }
}

impl Default for Corrected {
    fn default() -> Self {
        Self::new()
    }
}

impl Filter for Corrected {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let simulated = Simulated {
            rows: InputRows::new(&self.rows, SIMULATED),
            scales: &self.scales,
            process: Process { explained: Triangle::NONE, ..self.process(2.5) },
        };
        let correction = Correction {
            rows: InputRows::new(&self.rows, ROWS),
            scales: &self.scales,
            direct: self.process(2.0),
            one_sided: [],
            residual: self.process(3.0),
            simulated: Some(simulated),
            limits: StrainRange { lower: -9.0, upper: 9.0 },
            strain_variance: 0.7,
            variance_factor: 1.1,
        };
        let inputs = std::array::from_fn(|i| reading * (1.0 + 0.1 * i as f64));
        self.strain = correction.correct(&inputs, Gaussian { mean: inputs[0], variance: 0.1 }, 1.0).strain.mean;
        self.strain.is_finite()
    }

    fn strain(&self) -> f64 {
        self.strain
    }
}
