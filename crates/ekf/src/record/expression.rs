use core::cmp::Ordering;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use ohmstrain_model::Number;

use super::operation::{Operation, Place, Recorded};
use super::tape::Tape;
use crate::Recordable;
use crate::kernel::tail::Tail;
use crate::kernel::{Falls, Lanes};

/// A number known only when the recorded function runs, or a literal of the source text.
#[derive(Clone, Copy)]
pub struct Expression<'a>(pub(super) Kind<'a>);

#[derive(Clone, Copy)]
pub(super) enum Kind<'a> {
    /// A literal, not on a tape yet.
    Literal(f32),
    On(&'a Tape, Place),
}

/// NaNs have room for the index of the input for which they stand.
const NO_NUMBER: u32 = 0x7fc0_0000;
const ROOM: u32 = 0x003f_ffff;

/// Returns a NaN that stands for an input where the kernel expects a constant. The kernel computes with constants only in
/// lanes; the tests of every piece would reveal otherwise.
pub(super) fn standing_for(input: usize) -> f32 {
    f32::from_bits(NO_NUMBER | (input as u32 & ROOM))
}

fn stood_for(number: f32) -> Option<usize> {
    number.is_nan().then_some((number.to_bits() & ROOM) as usize)
}

impl Tape {
    pub(super) fn input(&self, number: usize) -> Expression<'_> {
        self.put(Operation::Input(number))
    }

    /// Records the operation, and returns its place as an expression.
    pub(super) fn put(&self, operation: Operation) -> Expression<'_> {
        Expression(Kind::On(self, self.place(operation)))
    }

    /// Records a known truth value.
    pub(super) fn known(&self, truth: bool) -> Expression<'_> {
        self.put(Operation::Known(truth))
    }

    pub(super) fn recorded<'a>(&'a self, results: impl IntoIterator<Item = Expression<'a>>) -> Recorded {
        let results = results.into_iter().map(|result| result.place_on(self)).collect();
        Recorded { operations: self.operations(), results }
    }
}

impl<'a> Expression<'a> {
    pub(super) const ZERO: Self = Self(Kind::Literal(0.0));

    /// Applies an operation to this number, on its tape.
    fn then(self, done: impl Fn(f32) -> f32, operation: impl Fn(Place) -> Operation) -> Self {
        match self.0 {
            Kind::Literal(number) => Self(Kind::Literal(done(number))),
            Kind::On(tape, place) => tape.put(operation(place)),
        }
    }

    /// Records the operation, even on a constant.
    fn noted(self, operation: impl Fn(Place) -> Operation) -> Self {
        self.then(|_| f32::NAN, operation)
    }

    pub(super) fn place_on(self, tape: &Tape) -> Place {
        match self.0 {
            Kind::Literal(number) => tape.place(Operation::Constant(number)),
            Kind::On(_, place) => place,
        }
    }

    fn operation(self) -> Operation {
        match self.0 {
            Kind::Literal(number) => Operation::Constant(number),
            Kind::On(tape, place) => tape.operation(place),
        }
    }

    fn constant(self) -> Option<f32> {
        if let Operation::Constant(number) = self.operation() { Some(number) } else { None }
    }

    fn truth(self) -> Option<bool> {
        if let Operation::Known(truth) = self.operation() { Some(truth) } else { None }
    }

    /// Returns the tape of either expression, if any.
    fn tape(self, other: Self) -> Option<&'a Tape> {
        match (self.0, other.0) {
            (Kind::On(tape, _), _) | (_, Kind::On(tape, _)) => Some(tape),
            _ => None,
        }
    }

    /// Applies an operation to two numbers, immediately if both are constants.
    fn on(self, other: Self, done: fn(f32, f32) -> f32, operation: fn(Place, Place) -> Operation) -> Self {
        let known = self.constant().zip(other.constant()).map(|(a, b)| done(a, b));
        match (self.tape(other), known) {
            (Some(tape), Some(known)) => tape.put(Operation::Constant(known)),
            (Some(tape), None) => tape.put(operation(self.place_on(tape), other.place_on(tape))),
            (None, known) => Self(Kind::Literal(known.unwrap_or(f32::NAN))),
        }
    }

    /// Selects the other number where a mask is set; for literals the result is `done`.
    fn either_of(self, other: Self, done: fn(f32, f32) -> f32, mask: Self) -> Self {
        match (self.0, other.0) {
            (Kind::Literal(a), Kind::Literal(b)) => Self(Kind::Literal(done(a, b))),
            _ => Self::pick(mask, other, self),
        }
    }

    /// Returns the result of a comparison on the path being recorded.
    fn ask(self, other: Self, done: fn(f32, f32) -> bool, operation: fn(Place, Place) -> Operation) -> bool {
        match (self.constant().zip(other.constant()), self.tape(other)) {
            (Some((a, b)), _) => done(a, b),
            (None, Some(tape)) => tape.ask(operation(self.place_on(tape), other.place_on(tape))),
            (None, None) => false,
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

impl Mul for Expression<'_> {
    type Output = Self;
    /// Multiplies; factors of one are omitted.
    fn mul(self, other: Self) -> Self {
        match (self.constant(), other.constant()) {
            (None, Some(1.0)) => self,
            (Some(1.0), None) => other,
            _ => self.on(other, |a, b| a * b, Operation::Multiply),
        }
    }
}

impl MulAssign for Expression<'_> {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl Div for Expression<'_> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.on(other, |a, b| a / b, Operation::Divide)
    }
}

impl Neg for Expression<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        match (self.0, self.constant()) {
            (Kind::On(tape, _), Some(known)) => tape.put(Operation::Constant(-known)),
            _ => self.then(|known| -known, Operation::Negate),
        }
    }
}

impl PartialEq for Expression<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.ask(*other, |a, b| a == b, Operation::Equal)
    }
}

/// Compares by a question, whose answer selects the recorded path.
impl PartialOrd for Expression<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let (less, more) = (self < other, self > other);
        [(less, Ordering::Less), (more, Ordering::Greater)]
            .into_iter()
            .find_map(|(is, ordering)| is.then_some(ordering))
            .or_else(|| (self == other).then_some(Ordering::Equal))
    }

    fn lt(&self, other: &Self) -> bool {
        self.ask(*other, |a, b| a < b, Operation::Less)
    }

    fn gt(&self, other: &Self) -> bool {
        other.lt(self)
    }

    fn le(&self, other: &Self) -> bool {
        self.ask(*other, |a, b| a <= b, Operation::AtMost)
    }

    fn ge(&self, other: &Self) -> bool {
        other.le(self)
    }
}

impl Number for Expression<'_> {
    fn of(value: f64) -> Self {
        Self(Kind::Literal(value as f32))
    }

    fn max(self, other: Self) -> Self {
        self.either_of(other, f32::max, self.less(other))
    }

    fn min(self, other: Self) -> Self {
        self.either_of(other, f32::min, other.less(self))
    }

    fn abs(self) -> Self {
        self.then(f32::abs, Operation::Absolute)
    }

    fn sqrt(self) -> Self {
        self.then(f32::sqrt, Operation::Root)
    }

    fn exp(self) -> Self {
        self.then(f32::exp, Operation::Exponential)
    }

    fn exp_m1(self) -> Self {
        self.then(f32::exp_m1, Operation::ExponentialLessOne)
    }

    fn tanh(self) -> Self {
        self.then(f32::tanh, Operation::Tangent)
    }

    fn is_finite(self) -> bool {
        match self.0 {
            Kind::Literal(number) => number.is_finite(),
            Kind::On(tape, place) => tape.ask(Operation::Finite(place)),
        }
    }
}

impl Recordable for Expression<'_> {}

impl Lanes for Expression<'_> {
    type Number = f32;
    type Mask = Self;

    const WIDTH: usize = 1;

    fn with(self, number: f32) -> Self {
        match self.0 {
            Kind::Literal(_) => Self(Kind::Literal(number)),
            Kind::On(tape, _) => tape.put(stood_for(number).map_or(Operation::Constant(number), Operation::Input)),
        }
    }

    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    fn recip(self) -> Self {
        self.literal(1.0) / self
    }

    fn over(self, divisor: Self) -> Self {
        self / divisor
    }

    fn root(self) -> Self {
        self.sqrt()
    }

    fn exponential(self) -> Self {
        self.exp()
    }

    fn less(self, other: Self) -> Self {
        match (self.tape(other), self.constant().zip(other.constant())) {
            (Some(tape), Some((a, b))) => tape.known(a < b),
            (Some(tape), None) => tape.put(Operation::Less(self.place_on(tape), other.place_on(tape))),
            // Literals are compared immediately.
            (None, _) => self,
        }
    }

    fn not_negative(self) -> Self {
        self.noted(Operation::NotNegative)
    }

    fn finite(self) -> Self {
        self.noted(Operation::Finite)
    }

    fn both(a: Self, b: Self) -> Self {
        match (a.truth(), b.truth()) {
            (Some(true), _) | (_, Some(false)) => b,
            (_, Some(true)) | (Some(false), _) => a,
            _ => a.on(b, |_, _| f32::NAN, Operation::Both),
        }
    }

    fn either(a: Self, b: Self) -> Self {
        match (a.truth(), b.truth()) {
            (Some(true), _) | (_, Some(false)) => a,
            (_, Some(true)) | (Some(false), _) => b,
            _ => a.on(b, |_, _| f32::NAN, Operation::Either),
        }
    }

    fn without(a: Self, b: Self) -> Self {
        let known = |truth: bool| match b.0 {
            Kind::On(tape, _) => tape.known(truth),
            Kind::Literal(_) => b,
        };
        let others = b.truth().map_or_else(|| b.noted(Operation::Not), |truth| known(!truth));
        let is_same = a.tape(b).is_some_and(|tape| a.place_on(tape) == b.place_on(tape));
        if is_same { known(false) } else { Self::both(a, others) }
    }

    fn none(mask: Self) -> bool {
        mask.truth() == Some(false)
    }

    fn all(mask: Self) -> bool {
        mask.truth() == Some(true)
    }

    fn pick(mask: Self, yes: Self, no: Self) -> Self {
        match (mask.truth(), mask.0) {
            (Some(true), _) => yes,
            (Some(false), _) => no,
            (None, Kind::On(tape, place)) => {
                let (yes_place, no_place) = (yes.place_on(tape), no.place_on(tape));
                if yes_place == no_place { yes } else { tape.put(Operation::Pick(place, yes_place, no_place)) }
            }
            (None, Kind::Literal(_)) => no,
        }
    }

    fn one_of<'b, R>(mask: Self, yes: &'b R, no: &'b R) -> Option<&'b R> {
        mask.truth().map(|truth| if truth { yes } else { no })
    }

    fn region<R>(self, _: f32, _: f32, _: [&R; 3]) -> Option<&R> {
        None
    }
}

/// Implementation for expressions, with the numbers of single precision.
impl Falls for Expression<'_> {
    fn to_exponent(self) -> Self {
        self.noted(Operation::ToExponent)
    }

    /// Records a separate function.
    fn falling(self) -> Self {
        self.then(Falls::falling, Operation::Falling)
    }

    /// Records a separate function.
    fn tail(self, _: Self) -> Tail<Self> {
        let mass = self.noted(Operation::Tail);
        Tail { mass, hazard: mass.noted(Operation::Hazard) }
    }
}
