use ohmstrain_ekf::{Belief, Channel, Dynamics};
use ohmstrain_model::{ParameterError, Scalar};

/// Models that differ in a few positive parameters. `L = N (N + 1) / 2`.
pub trait ModelFamily<const N: usize, const L: usize> {
    /// A model with numbers of type `T`.
    type Model<T: Scalar>: Dynamics<T, N, L> + Channel<T, N, L>;

    /// Returns the model with these parameters, on their natural scale.
    ///
    /// # Errors
    /// Names the parameter whose value no model can have.
    fn model<T: Scalar>(&self, parameters: &[T]) -> Result<Self::Model<T>, ParameterError>;

    /// Returns the belief before the first reading. That reading is an update without a prediction.
    fn start<T: Scalar>(&self, model: &Self::Model<T>) -> Belief<T, N, L>;
}

/// A parameter of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Starting value of the search, in the parameter's unit.
    pub start: f64,
    /// Smallest value allowed, positive.
    pub lower: f64,
    /// Largest value allowed.
    pub upper: f64,
}

impl Parameter {
    /// Returns a parameter that may be a million times smaller or larger than its start.
    #[must_use]
    pub const fn around(name: &'static str, start: f64) -> Self {
        Self { name, start, lower: start * 1e-6, upper: start * 1e6 }
    }
}
