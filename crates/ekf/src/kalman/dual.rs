use nalgebra::{SMatrix, SVector};
use num_dual::{Dual, DualNumFloat};
use ohmstrain_model::Scalar;

use super::{Differentiable, Model};

/// A model whose Jacobians come from dual numbers: they are exact, and take one evaluation of the function per state.
///
/// The model is generic over its number type, `impl<T: Scalar> Model<T, 2, 1> for Pendulum`, with constants as
/// `T::of(9.81)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByDual<M>(
    /// The model.
    pub M,
);

impl<T: Scalar, D: Model<T, N, M>, const N: usize, const M: usize> Model<T, N, M> for ByDual<D> {
    fn transition(&self, x: &SVector<T, N>) -> SVector<T, N> {
        self.0.transition(x)
    }

    fn reading(&self, x: &SVector<T, N>) -> SVector<T, M> {
        self.0.reading(x)
    }
}

impl<T, D, const N: usize, const M: usize> Differentiable<T, N, M> for ByDual<D>
where
    T: Scalar + DualNumFloat,
    Dual<T>: Scalar,
    D: Model<T, N, M> + Model<Dual<T>, N, M>,
{
    fn transition_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, N, N> {
        jacobian(x, |x| self.0.transition(x))
    }

    fn reading_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, M, N> {
        jacobian(x, |x| self.0.reading(x))
    }
}

/// Returns the Jacobian; column j comes from an evaluation with a dual part in entry j.
fn jacobian<T, const R: usize, const N: usize>(
    x: &SVector<T, N>,
    function: impl Fn(&SVector<Dual<T>, N>) -> SVector<Dual<T>, R>,
) -> SMatrix<T, R, N>
where
    T: Scalar,
    Dual<T>: Scalar,
{
    let mut out = SMatrix::zeros();
    for j in 0..N {
        let seeded = SVector::from_fn(|i, _| Dual { re: x[i], eps: if i == j { T::one() } else { T::zero() } });
        let column = function(&seeded);
        for i in 0..R {
            out[(i, j)] = column[i].eps;
        }
    }
    out
}
