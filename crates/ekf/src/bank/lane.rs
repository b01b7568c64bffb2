use core::fmt::Debug;

use fearless_simd::{Simd, SimdFloat, SimdFloatElement, f32x16, f64x8};

use crate::{Real, StepError};

/// `f32` or `f64`: a number of which a vector register holds several.
#[allow(private_bounds, reason = "sealed: the rows are laid out for these two")]
pub trait Lane: Real + SimdFloatElement + Rows {}

impl Lane for f32 {}
impl Lane for f64 {}

/// The same number of each sensor of a block, 64 bytes: one vector of 512 bits, two of 256, four of 128.
pub(super) trait Rows: Copy + SimdFloatElement {
    type Row: AsRef<[Self]> + AsMut<[Self]> + Copy + Debug + Send + Sync;
    /// A row in registers.
    type Vector<S: Simd>: SimdFloat<S, Element = Self>;

    /// A row with one number for all.
    fn row(number: Self) -> Row<Self::Row>;
}

impl Rows for f32 {
    type Row = [Self; 16];
    type Vector<S: Simd> = f32x16<S>;

    fn row(number: Self) -> Row<Self::Row> {
        Row([number; 16])
    }
}

impl Rows for f64 {
    type Row = [Self; 8];
    type Vector<S: Simd> = f64x8<S>;

    fn row(number: Self) -> Row<Self::Row> {
        Row([number; 8])
    }
}

/// A cache line: no load or store of a vector touches two.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Row<A>(pub(super) A);

/// Sensors that are stepped together, and what the last step did to each.
#[derive(Clone, Debug)]
pub(super) struct Block<T: Lane, const N: usize, const L: usize> {
    pub(super) mean: [Row<T::Row>; N],
    pub(super) covariance: [Row<T::Row>; L],
    /// Of the last step, where a reading was taken.
    pub(super) innovation: Row<T::Row>,
    pub(super) innovation_variance: Row<T::Row>,
    /// Bit i belongs to sensor i.
    pub(super) taken: u32,
    pub(super) refused: u32,
    /// Why, where the bit in `refused` is set.
    pub(super) errors: [StepError; 16],
}
