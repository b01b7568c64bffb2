use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

/// Model of N states and M simultaneous readings, given by two functions.
///
/// ```text
/// x′ = f(x) + w,  w ~ N(0, Q)      transition
/// y  = h(x) + v,  v ~ N(0, R)      reading
/// ```
///
/// A pair `(f, h)` of functions or closures is a model. A dedicated type can hold values that change from step to step,
/// such as the step's length or a control input: `Pendulum { dt_s, torque }` is the model of one step. Q and R belong
/// to the filter.
pub trait Model<T: Scalar, const N: usize, const M: usize> {
    /// Returns f(x), the state one step after x, without noise.
    fn transition(&self, x: &SVector<T, N>) -> SVector<T, N>;

    /// Returns h(x), the readings expected in state x.
    fn reading(&self, x: &SVector<T, N>) -> SVector<T, M>;
}

/// A model with hand-written Jacobians, such as `(f, F, h, H)`. `ByDual` (feature `dual`) computes them with dual
/// numbers.
pub trait Differentiable<T: Scalar, const N: usize, const M: usize>: Model<T, N, M> {
    /// Returns F = ∂f/∂x, with row i for entry i of f.
    fn transition_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Returns H = ∂h/∂x, with row i for reading i.
    fn reading_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, M, N>;
}

impl<T, F, H, const N: usize, const M: usize> Model<T, N, M> for (F, H)
where
    T: Scalar,
    F: Fn(&SVector<T, N>) -> SVector<T, N>,
    H: Fn(&SVector<T, N>) -> SVector<T, M>,
{
    fn transition(&self, x: &SVector<T, N>) -> SVector<T, N> {
        self.0(x)
    }

    fn reading(&self, x: &SVector<T, N>) -> SVector<T, M> {
        self.1(x)
    }
}

impl<T, F, DF, H, DH, const N: usize, const M: usize> Model<T, N, M> for (F, DF, H, DH)
where
    T: Scalar,
    F: Fn(&SVector<T, N>) -> SVector<T, N>,
    H: Fn(&SVector<T, N>) -> SVector<T, M>,
{
    fn transition(&self, x: &SVector<T, N>) -> SVector<T, N> {
        self.0(x)
    }

    fn reading(&self, x: &SVector<T, N>) -> SVector<T, M> {
        self.2(x)
    }
}

impl<T, F, DF, H, DH, const N: usize, const M: usize> Differentiable<T, N, M> for (F, DF, H, DH)
where
    T: Scalar,
    F: Fn(&SVector<T, N>) -> SVector<T, N>,
    DF: Fn(&SVector<T, N>) -> SMatrix<T, N, N>,
    H: Fn(&SVector<T, N>) -> SVector<T, M>,
    DH: Fn(&SVector<T, N>) -> SMatrix<T, M, N>,
{
    fn transition_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, N, N> {
        self.1(x)
    }

    fn reading_jacobian(&self, x: &SVector<T, N>) -> SMatrix<T, M, N> {
        self.3(x)
    }
}
