use std::vec::Vec;

/// Index of an earlier operation in [`Recorded::operations`].
pub type Place = usize;

/// An operation on earlier results. Sums, products and quotients are rounded one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operation {
    /// The input with this index, a number.
    Input(usize),
    /// The input with this index, a truth value.
    Flag(usize),
    /// A constant.
    Constant(f32),
    /// A sum.
    Add(Place, Place),
    /// A difference.
    Subtract(Place, Place),
    /// A product.
    Multiply(Place, Place),
    /// A quotient.
    Divide(Place, Place),
    /// The number with its sign changed.
    Negate(Place),
    /// The number without its sign.
    Absolute(Place),
    /// A square root.
    Root(Place),
    /// An exponential.
    Exponential(Place),
    /// An exponential minus one.
    ExponentialLessOne(Place),
    /// A hyperbolic tangent.
    Tangent(Place),
    /// An exponential of a number up to zero.
    Falling(Place),
    /// The number with its bits shifted into the exponent.
    ToExponent(Place),
    /// Upper tail of a standard normal above a border.
    Tail(Place),
    /// Density at the border of such a tail, divided by the tail.
    Hazard(Place),
    /// True if the first is less than the second.
    Less(Place, Place),
    /// True if the first is at most the second.
    AtMost(Place, Place),
    /// True if both are the same number.
    Equal(Place, Place),
    /// True if a number is zero or more; false for NaN.
    NotNegative(Place),
    /// True if a number is finite.
    Finite(Place),
    /// True if both are true.
    Both(Place, Place),
    /// True if either is true.
    Either(Place, Place),
    /// True if the operand is false.
    Not(Place),
    /// A known truth value.
    Known(bool),
    /// The second operand if the first is true, otherwise the third.
    Pick(Place, Place, Place),
}

impl Operation {
    /// True if the result is a truth value, not a number.
    #[must_use]
    pub const fn is_truth(self) -> bool {
        matches!(
            self,
            Self::Flag(_)
                | Self::Less(..)
                | Self::AtMost(..)
                | Self::Equal(..)
                | Self::NotNegative(_)
                | Self::Finite(_)
                | Self::Both(..)
                | Self::Either(..)
                | Self::Not(_)
                | Self::Known(_)
        )
    }

    /// Returns the places of its operands.
    pub fn operands(self) -> impl Iterator<Item = Place> {
        let (a, b, c) = match self {
            Self::Input(_) | Self::Flag(_) | Self::Constant(_) | Self::Known(_) => (None, None, None),
            Self::Negate(a)
            | Self::Absolute(a)
            | Self::Root(a)
            | Self::Exponential(a)
            | Self::ExponentialLessOne(a)
            | Self::Tangent(a)
            | Self::Falling(a)
            | Self::ToExponent(a)
            | Self::Tail(a)
            | Self::Hazard(a)
            | Self::NotNegative(a)
            | Self::Finite(a)
            | Self::Not(a) => (Some(a), None, None),
            Self::Add(a, b)
            | Self::Subtract(a, b)
            | Self::Multiply(a, b)
            | Self::Divide(a, b)
            | Self::Less(a, b)
            | Self::AtMost(a, b)
            | Self::Equal(a, b)
            | Self::Both(a, b)
            | Self::Either(a, b) => (Some(a), Some(b), None),
            Self::Pick(a, b, c) => (Some(a), Some(b), Some(c)),
        };
        [a, b, c].into_iter().flatten()
    }
}

/// A function from inputs to results without branches.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Operations, each on results of earlier ones.
    pub operations: Vec<Operation>,
    /// Places of the results.
    pub results: Vec<Place>,
}
