use core::cell::RefCell;
use core::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use std::vec::Vec;

use crate::kernel::tail::Tail;
use crate::kernel::{Falls, Lanes};

/// Where an earlier operation stands in [`Recorded::operations`].
pub type Place = usize;

/// An operation on earlier results. Sums, products and quotients are rounded one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operation {
    /// The input of this number.
    Input(usize),
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
    /// The number with its sign turned.
    Negate(Place),
    /// A square root.
    Root(Place),
    /// An exponential.
    Exponential(Place),
    /// An exponential of what is not above zero.
    Falling(Place),
    /// The number with its bits shifted to where an exponent stands.
    ToExponent(Place),
    /// What a standard normal has above a border.
    Tail(Place),
    /// Its density at the border of such a tail, over the tail.
    Hazard(Place),
    /// Whether the first is less than the second.
    Less(Place, Place),
    /// Whether a number is zero or more; not if it is not a number.
    NotNegative(Place),
    /// Whether a number is finite.
    Finite(Place),
    /// Whether both are true.
    Both(Place, Place),
    /// Whether one of both is true.
    Either(Place, Place),
    /// Whether it is not true.
    Not(Place),
    /// What is known to be true, or false.
    Known(bool),
    /// The second where the first is true, else the third.
    Pick(Place, Place, Place),
}

impl Operation {
    /// The places of what it takes.
    pub fn operands(self) -> impl Iterator<Item = Place> {
        let (a, b, c) = match self {
            Self::Input(_) | Self::Constant(_) | Self::Known(_) => (None, None, None),
            Self::Negate(a)
            | Self::Root(a)
            | Self::Exponential(a)
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
            | Self::Both(a, b)
            | Self::Either(a, b) => (Some(a), Some(b), None),
            Self::Pick(a, b, c) => (Some(a), Some(b), Some(c)),
        };
        [a, b, c].into_iter().flatten()
    }
}

/// A function from inputs to results without a choice of way.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Operations, each on results of earlier ones.
    pub operations: Vec<Operation>,
    /// Where the results stand.
    pub results: Vec<Place>,
}

/// Operations as they come.
#[derive(Default)]
pub(super) struct Tape {
    operations: RefCell<Vec<Operation>>,
}

/// A number, or a truth, that is known when the recorded function runs.
#[derive(Clone, Copy)]
pub(super) struct Expression<'a> {
    tape: &'a Tape,
    place: Place,
}

impl Tape {
    pub(super) fn input(&self, number: usize) -> Expression<'_> {
        self.put(Operation::Input(number))
    }

    /// The place of an operation: of the same one, if it was done before.
    fn put(&self, operation: Operation) -> Expression<'_> {
        let mut operations = self.operations.borrow_mut();
        let place = operations.iter().position(|known| same(*known, operation)).unwrap_or(operations.len());
        if place == operations.len() {
            operations.push(operation);
        }
        Expression { tape: self, place }
    }

    /// A truth.
    pub(super) fn known(&self, truth: bool) -> Expression<'_> {
        self.put(Operation::Known(truth))
    }

    pub(super) fn recorded<'a>(&self, results: impl IntoIterator<Item = Expression<'a>>) -> Recorded {
        let results = results.into_iter().map(|result| result.place).collect();
        Recorded { operations: self.operations.borrow().clone(), results }
    }
}

/// Numbers that are none have room for the number of an input that they stand for.
const NO_NUMBER: u32 = 0x7fc0_0000;
const ROOM: u32 = 0x003f_ffff;

/// A number that stands for an input wherever the kernel takes it for a constant. The kernel computes with constants in lanes
/// only, which the tests of every piece would show.
pub(super) fn standing_for(input: usize) -> f32 {
    f32::from_bits(NO_NUMBER | (input as u32 & ROOM))
}

fn stood_for(number: f32) -> Option<usize> {
    number.is_nan().then_some((number.to_bits() & ROOM) as usize)
}

/// Zeros of both signs compare as equal, and are not the same.
fn same(a: Operation, b: Operation) -> bool {
    match (a, b) {
        (Operation::Constant(a), Operation::Constant(b)) => a.to_bits() == b.to_bits(),
        _ => a == b,
    }
}

impl<'a> Expression<'a> {
    fn with(self, operation: Operation) -> Self {
        self.tape.put(operation)
    }

    fn operation(self) -> Operation {
        self.tape.operations.borrow().get(self.place).copied().unwrap_or(Operation::Known(false))
    }

    fn constant(self) -> Option<f32> {
        if let Operation::Constant(number) = self.operation() { Some(number) } else { None }
    }

    fn truth(self) -> Option<bool> {
        if let Operation::Known(truth) = self.operation() { Some(truth) } else { None }
    }

    /// An operation on two numbers, done at once if both are known.
    fn on(self, other: Self, done: fn(f32, f32) -> f32, operation: fn(Place, Place) -> Operation) -> Self {
        match (self.constant(), other.constant()) {
            (Some(a), Some(b)) => self.with(Operation::Constant(done(a, b))),
            _ => self.with(operation(self.place, other.place)),
        }
    }
}

macro_rules! operation {
    ($trait:ident $method:ident, $assign:ident $assigned:ident, $operation:ident) => {
        impl $trait for Expression<'_> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.on(other, |a, b| a.$method(b), Operation::$operation)
            }
        }
        impl $assign for Expression<'_> {
            fn $assigned(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    };
}
operation!(Add add, AddAssign add_assign, Add);
operation!(Sub sub, SubAssign sub_assign, Subtract);
operation!(Mul mul, MulAssign mul_assign, Multiply);

impl Neg for Expression<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.constant().map_or(self.with(Operation::Negate(self.place)), |known| self.with(Operation::Constant(-known)))
    }
}

impl Lanes for Expression<'_> {
    type Number = f32;
    type Mask = Self;

    const WIDTH: usize = 1;

    fn with(self, number: f32) -> Self {
        self.tape.put(stood_for(number).map_or(Operation::Constant(number), Operation::Input))
    }

    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    fn recip(self) -> Self {
        self.literal(1.0).over(self)
    }

    fn over(self, divisor: Self) -> Self {
        self.on(divisor, |a, b| a / b, Operation::Divide)
    }

    fn root(self) -> Self {
        self.with(Operation::Root(self.place))
    }

    fn exponential(self) -> Self {
        self.with(Operation::Exponential(self.place))
    }

    fn less(self, other: Self) -> Self {
        match (self.constant(), other.constant()) {
            (Some(a), Some(b)) => self.with(Operation::Known(a < b)),
            _ => self.with(Operation::Less(self.place, other.place)),
        }
    }

    fn not_negative(self) -> Self {
        self.with(Operation::NotNegative(self.place))
    }

    fn finite(self) -> Self {
        self.with(Operation::Finite(self.place))
    }

    fn both(a: Self, b: Self) -> Self {
        match (a.truth(), b.truth()) {
            (Some(true), _) | (_, Some(false)) => b,
            (_, Some(true)) | (Some(false), _) => a,
            _ => a.with(Operation::Both(a.place, b.place)),
        }
    }

    fn either(a: Self, b: Self) -> Self {
        match (a.truth(), b.truth()) {
            (Some(true), _) | (_, Some(false)) => a,
            (_, Some(true)) | (Some(false), _) => b,
            _ => a.with(Operation::Either(a.place, b.place)),
        }
    }

    fn without(a: Self, b: Self) -> Self {
        let others = match b.truth() {
            Some(truth) => b.with(Operation::Known(!truth)),
            None => b.with(Operation::Not(b.place)),
        };
        if a.place == b.place { a.with(Operation::Known(false)) } else { Self::both(a, others) }
    }

    fn none(mask: Self) -> bool {
        mask.truth() == Some(false)
    }

    fn all(mask: Self) -> bool {
        mask.truth() == Some(true)
    }

    fn pick(mask: Self, yes: Self, no: Self) -> Self {
        match mask.truth() {
            _ if yes.place == no.place => yes,
            Some(true) => yes,
            Some(false) => no,
            None => mask.with(Operation::Pick(mask.place, yes.place, no.place)),
        }
    }

    fn one_of<'b, R>(mask: Self, yes: &'b R, no: &'b R) -> Option<&'b R> {
        mask.truth().map(|truth| if truth { yes } else { no })
    }

    fn region<R>(self, _: f32, _: f32, _: [&R; 3]) -> Option<&R> {
        None
    }
}

/// As numbers in single precision have it.
impl Falls for Expression<'_> {
    fn to_exponent(self) -> Self {
        self.with(Operation::ToExponent(self.place))
    }

    /// A function of its own.
    fn falling(self) -> Self {
        self.with(Operation::Falling(self.place))
    }

    /// A function of its own.
    fn tail(self, _: Self) -> Tail<Self> {
        let mass = self.with(Operation::Tail(self.place));
        Tail { mass, hazard: mass.with(Operation::Hazard(mass.place)) }
    }
}
