//! The learned correction of the exported program, in any precision.

use ohmstrain_calib::OwnedCorrection;
use ohmstrain_ekf::correction::{FEATURES, InputScale, OUTPUTS};
use ohmstrain_ekf::{Gaussian, Real};
use ohmstrain_model::StrainRange;

use super::quadratic::Quadratic;
use super::twin::number;

/// Inputs of the correction.
pub const INPUTS: usize = OUTPUTS + FEATURES;

/// A correction, and what stands for rows that were left out.
pub struct Learned<T: Real> {
    rows: OwnedCorrection<T, INPUTS>,
    /// Of the direct process and of the residual one.
    quadratics: Option<[Quadratic<T>; 2]>,
}

impl<T: Real> Learned<T> {
    /// In the precision of the program, with its limits.
    pub fn new(
        correction: &OwnedCorrection<f64, INPUTS>,
        quadratics: Option<&[Quadratic; 2]>,
        limits: StrainRange<T>,
    ) -> Self {
        let numbers = |all: &[f64]| all.iter().copied().map(number).collect();
        let narrow = |of: &Quadratic| Quadratic { linear: numbers(&of.linear), square: numbers(&of.square) };
        let rows = OwnedCorrection { limits, ..correction.map(number) };
        Self { rows, quadratics: quadratics.map(|both| both.each_ref().map(narrow)) }
    }

    /// The strain of a filter, corrected; `inputs` as [`ohmstrain_ekf::correction::Correction::correct`] has them.
    pub fn correct(&self, inputs: &[T; INPUTS], filtered: Gaussian<T>, birge: T) -> Gaussian<T> {
        let mut correction = self.rows.correction();
        if let Some([of_direct, of_residual]) = &self.quadratics {
            let x = self.standardised(inputs);
            correction.direct.mean += of_direct.value(&x[OUTPUTS..]);
            correction.residual.mean += of_residual.value(&x);
        }
        correction.correct(inputs, filtered, birge).strain
    }

    /// As the correction does it.
    fn standardised(&self, inputs: &[T; INPUTS]) -> [T; INPUTS] {
        let of =
            |(input, scale): (&T, &InputScale<T>)| (input.max(scale.lower).min(scale.upper) - scale.mean) / scale.sd;
        let mut standardised = inputs.iter().zip(&self.rows.scales).map(of);
        std::array::from_fn(|_| standardised.next().unwrap_or(T::zero()))
    }
}
