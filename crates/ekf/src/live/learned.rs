use crate::correction::{Correction, FILTER_INPUTS, OUTPUTS, Quadratic};
use crate::{Gaussian, Real};

/// Correction of a filter's strain, with a substitute for training rows that do not fit on a small microcontroller.
#[derive(Clone, Copy, Debug)]
pub struct Learned<'a, T> {
    /// Correction with the remaining rows.
    pub correction: Correction<'a, T, FILTER_INPUTS>,
    /// Quadratics added to the means of the direct process and of the residual one.
    pub quadratics: Option<[Quadratic<'a, T>; 2]>,
}

/// Corrects a filter's strain.
pub trait Correct<T> {
    /// Returns the corrected strain of a filter; arguments as for [`Correction::correct`].
    fn correct(&self, inputs: &[T; FILTER_INPUTS], filtered: Gaussian<T>, birge: T) -> Gaussian<T>;
}

impl<T: Real> Correct<T> for Learned<'_, T> {
    fn correct(&self, inputs: &[T; FILTER_INPUTS], filtered: Gaussian<T>, birge: T) -> Gaussian<T> {
        let Some([of_direct, of_residual]) = &self.quadratics else {
            return self.correction.correct(inputs, filtered, birge).strain;
        };
        let mut correction = self.correction;
        let x = correction.standardised(inputs);
        correction.direct.mean += of_direct.value(x.get(OUTPUTS..).unwrap_or(&[]));
        correction.residual.mean += of_residual.value(&x);
        correction.correct(inputs, filtered, birge).strain
    }
}
