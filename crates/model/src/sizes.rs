use crate::{Scalar, SwitchedModel};

/// Number of branches, which determines all sizes.
#[derive(Clone, Copy, Debug)]
pub struct Branches<const B: usize>;

/// Models with a given number of branches: strain, rate, the branches and optionally a baseline.
pub trait Models {
    /// Model with a baseline: `N = B + 3`.
    type WithBaseline<T: Scalar>;
    /// Model without a baseline: `N = B + 2`.
    type WithoutBaseline<T: Scalar>;
}

/// Model with `B` branches, at most four, and a drifting baseline.
///
/// ```
/// use ohmstrain_model::{SwitchedModel, WithBaseline};
///
/// fn same(sensor: WithBaseline<f32, 1>) -> SwitchedModel<f32, 1, 4> {
///     sensor
/// }
/// ```
pub type WithBaseline<T, const B: usize> = <Branches<B> as Models>::WithBaseline<T>;

/// Model with `B` branches, at most four, without a baseline.
pub type WithoutBaseline<T, const B: usize> = <Branches<B> as Models>::WithoutBaseline<T>;

macro_rules! models {
    ($($branches:literal: $without:literal, $with:literal);+) => {$(
        impl Models for Branches<$branches> {
            type WithBaseline<T: Scalar> = SwitchedModel<T, $branches, $with>;
            type WithoutBaseline<T: Scalar> = SwitchedModel<T, $branches, $without>;
        }
    )+};
}

models!(0: 2, 3; 1: 3, 4; 2: 4, 5; 3: 5, 6; 4: 6, 7);
