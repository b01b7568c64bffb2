//! Report of a program, in the layout of `firmware/src/frame.rs`.

use std::error::Error;
use std::path::Path;

/// Counts and results of a program.
pub struct Run {
    /// Mean instructions of a step over all readings.
    pub instructions: f64,
    /// Instructions of the most expensive step.
    pub dearest: u32,
    /// Instructions to convert one code.
    pub conversion: f64,
    /// Worst stack of a step, bytes.
    pub stack: u32,
    /// Size of the state, bytes.
    pub state: u32,
    /// Number of refused readings.
    pub refused: u32,
    /// Strain after every reading.
    pub strains: Vec<f32>,
}

impl Run {
    /// Reads a program's report.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let bytes = std::fs::read(path)?;
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
        let [steps, all, dearest, conversion, stack, state, refused, strains @ ..] = words.as_slice() else {
            return Err(format!("{}: the program did not report", path.display()).into());
        };
        if strains.len() != *steps as usize {
            return Err(format!("{}: {} strains of {steps}", path.display(), strains.len()).into());
        }
        let per_step = |total: u32| f64::from(total) / f64::from(*steps);
        Ok(Self {
            instructions: per_step(*all),
            dearest: *dearest,
            conversion: per_step(*conversion),
            stack: *stack,
            state: *state,
            refused: *refused,
            strains: strains.iter().map(|bits| f32::from_bits(*bits)).collect(),
        })
    }

    /// Returns the root mean square of the strains' errors.
    pub fn rms_error(&self, truth: &[f64]) -> f64 {
        let squares = self.strains.iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).powi(2));
        (squares.sum::<f64>() / self.strains.len() as f64).sqrt()
    }

    /// Returns the largest difference of a strain from its reference.
    pub fn difference(&self, reference: &[f64]) -> f64 {
        self.strains.iter().zip(reference).fold(0.0, |most, (a, b)| {
            let apart = (f64::from(*a) - b).abs();
            // NaN must not be hidden by `max`.
            if apart.is_nan() || apart > most { apart } else { most }
        })
    }
}
