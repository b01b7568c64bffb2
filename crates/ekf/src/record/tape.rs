use core::cell::RefCell;
use std::vec::Vec;

use super::operation::{Operation, Place};

/// Operations in order, and the paths selected by comparisons.
#[derive(Default)]
pub(super) struct Tape {
    operations: RefCell<Vec<Operation>>,
    /// Questions asked on this path, and their answers; answers given beforehand are used in turn.
    asked: RefCell<Vec<Place>>,
    answers: RefCell<Vec<bool>>,
}

impl Tape {
    /// Returns the place of an operation; an operation that was already recorded keeps its place.
    pub(super) fn place(&self, operation: Operation) -> Place {
        let mut operations = self.operations.borrow_mut();
        let place = operations.iter().position(|known| same(*known, operation)).unwrap_or(operations.len());
        if place == operations.len() {
            operations.push(operation);
        }
        place
    }

    /// Returns the answer that selects the path: the one given beforehand, otherwise true.
    pub(super) fn ask(&self, operation: Operation) -> bool {
        let place = self.place(operation);
        let (mut asked, mut answers) = (self.asked.borrow_mut(), self.answers.borrow_mut());
        let number = asked.iter().position(|known| *known == place).unwrap_or(asked.len());
        if number == asked.len() {
            asked.push(place);
        }
        if number == answers.len() {
            answers.push(true);
        }
        answers.get(number).copied().unwrap_or(true)
    }

    /// Begins a path with these first answers.
    pub(super) fn answer(&self, answers: &[bool]) {
        self.asked.borrow_mut().clear();
        *self.answers.borrow_mut() = answers.to_vec();
    }

    /// Returns the questions asked on this path.
    pub(super) fn asked(&self) -> Vec<Place> {
        self.asked.borrow().clone()
    }

    pub(super) fn operations(&self) -> Vec<Operation> {
        self.operations.borrow().clone()
    }

    pub(super) fn operation(&self, place: Place) -> Operation {
        self.operations.borrow().get(place).copied().unwrap_or(Operation::Known(false))
    }

    fn not(&self, truth: Place) -> Place {
        match self.operation(truth) {
            Operation::Known(truth) => self.place(Operation::Known(!truth)),
            Operation::Not(of) => of,
            _ => self.place(Operation::Not(truth)),
        }
    }

    /// True if a truth value needs no division, root or exponential, and so costs little even if it is not needed.
    fn is_cheap(&self, place: Place) -> bool {
        let operation = self.operation(place);
        let is_dear = matches!(
            operation,
            Operation::Divide(..)
                | Operation::Root(_)
                | Operation::Exponential(_)
                | Operation::ExponentialLessOne(_)
                | Operation::Tangent(_)
                | Operation::Falling(_)
                | Operation::Tail(_)
        );
        !is_dear && operation.operands().all(|operand| self.is_cheap(operand))
    }

    /// Returns the selection between two results, numbers or truth values.
    pub(super) fn choose(&self, mask: Place, yes: Place, no: Place) -> Place {
        let [both, either] = [Operation::Both, Operation::Either].map(|of| move |a, b| self.place(of(a, b)));
        match (self.operation(yes), self.operation(no)) {
            _ if yes == no => yes,
            (Operation::Known(true), Operation::Known(false)) => mask,
            (Operation::Known(false), Operation::Known(true)) => self.not(mask),
            (Operation::Known(true), _) if self.is_cheap(no) => either(mask, no),
            (Operation::Known(false), _) if self.is_cheap(no) => both(self.not(mask), no),
            (_, Operation::Known(true)) if self.is_cheap(yes) => either(self.not(mask), yes),
            (_, Operation::Known(false)) if self.is_cheap(yes) => both(mask, yes),
            // Two selections of the same result are combined into one.
            (Operation::Pick(further, a, b), _) if b == no && self.is_cheap(further) => {
                self.choose(both(mask, further), a, no)
            }
            (Operation::Pick(further, a, b), _) if a == no && self.is_cheap(further) => {
                self.choose(both(mask, self.not(further)), b, no)
            }
            (_, Operation::Pick(further, a, b)) if a == yes && self.is_cheap(further) => {
                self.choose(either(mask, further), yes, b)
            }
            (_, Operation::Pick(further, a, b)) if b == yes && self.is_cheap(further) => {
                self.choose(either(mask, self.not(further)), yes, a)
            }
            // So are selections by the same question in both branches.
            (Operation::Pick(yes_if, a, b), Operation::Pick(no_if, c, d)) if yes_if == no_if && (a == c || b == d) => {
                let (first, second) = (self.choose(mask, a, c), self.choose(mask, b, d));
                self.choose(yes_if, first, second)
            }
            _ => self.place(Operation::Pick(mask, yes, no)),
        }
    }
}

/// True if two operations are the same. Zeros of both signs compare as equal but are not the same.
fn same(a: Operation, b: Operation) -> bool {
    match (a, b) {
        (Operation::Constant(a), Operation::Constant(b)) => a.to_bits() == b.to_bits(),
        _ => a == b,
    }
}
