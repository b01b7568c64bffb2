//! The learned correction of the exported program, in any precision.

use ohmstrain_calib::{PortableCorrection, PortableProcess};
use ohmstrain_ekf::correction::{Correction, FEATURES, InputScale, OUTPUTS, Process};
use ohmstrain_ekf::{Gaussian, Real};
use ohmstrain_model::StrainRange;

use super::quadratic::Quadratic;
use super::twin::number;

/// Inputs of the correction.
pub const INPUTS: usize = OUTPUTS + FEATURES;

/// A correction in any precision.
pub struct Table<T: Real> {
    rows: Vec<[T; INPUTS]>,
    scales: [InputScale<T>; INPUTS],
    direct: ProcessTable<T>,
    residual: ProcessTable<T>,
    /// What stands for rows that were left out, of both.
    quadratics: Option<[Quadratic<T>; 2]>,
    strain_variance: T,
    variance_factor: T,
}

struct ProcessTable<T: Real> {
    weights: Vec<T>,
    explained: Vec<T>,
    process: Process<'static, T>,
}

impl<T: Real> Table<T> {
    /// Of a correction, and what stands for rows that were left out.
    pub fn new(correction: &PortableCorrection, quadratics: Option<&[Quadratic; 2]>) -> Self {
        let numbers = |all: &[f64]| all.iter().copied().map(number).collect();
        let narrow = |of: &Quadratic| Quadratic { linear: numbers(&of.linear), square: numbers(&of.square) };
        Self {
            rows: correction.rows.iter().map(|row| row.map(number)).collect(),
            scales: correction.scales.map(|scale| InputScale {
                mean: number(scale.mean),
                sd: number(scale.sd),
                lower: number(scale.lower),
                upper: number(scale.upper),
            }),
            direct: ProcessTable::new(&correction.direct),
            residual: ProcessTable::new(&correction.residual),
            quadratics: quadratics.map(|both| both.each_ref().map(narrow)),
            strain_variance: number(correction.strain_variance),
            variance_factor: number(correction.variance_factor),
        }
    }

    /// The strain of a filter, corrected; `inputs` as [`Correction::correct`] has them.
    pub fn correct(&self, inputs: &[T; INPUTS], filtered: Gaussian<T>, limits: StrainRange<T>) -> Gaussian<T> {
        let (mut direct, mut residual) = (self.direct.process(), self.residual.process());
        if let Some([of_direct, of_residual]) = &self.quadratics {
            let x = self.standardised(inputs);
            direct.mean += of_direct.value(&x[OUTPUTS..]);
            residual.mean += of_residual.value(&x);
        }
        let correction = Correction {
            rows: &self.rows,
            scales: &self.scales,
            direct,
            one_sided: [],
            residual,
            limits,
            strain_variance: self.strain_variance,
            variance_factor: self.variance_factor,
        };
        correction.correct(inputs, filtered).strain
    }

    /// As the correction does it.
    fn standardised(&self, inputs: &[T; INPUTS]) -> [T; INPUTS] {
        let of =
            |(input, scale): (&T, &InputScale<T>)| (input.max(scale.lower).min(scale.upper) - scale.mean) / scale.sd;
        let mut standardised = inputs.iter().zip(&self.scales).map(of);
        std::array::from_fn(|_| standardised.next().unwrap_or(T::zero()))
    }
}

impl<T: Real> ProcessTable<T> {
    fn new(from: &PortableProcess) -> Self {
        let process = Process {
            length: number(from.length),
            mean: number(from.mean),
            weights: &[],
            explained: &[],
            variance: number(from.variance),
            noise: number(from.noise),
            widening: number(from.widening),
            least_variance: number(from.least_variance),
        };
        let numbers = |all: &[f64]| all.iter().copied().map(number).collect();
        Self { weights: numbers(&from.weights), explained: numbers(&from.explained), process }
    }

    fn process(&self) -> Process<'_, T> {
        Process { weights: &self.weights, explained: &self.explained, ..self.process }
    }
}
