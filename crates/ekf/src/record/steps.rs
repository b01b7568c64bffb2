use std::string::String;
use std::vec::Vec;

use ohmstrain_model::Scalar;

use crate::Real;
use crate::{Curve, Hypotheses, SignSplit, SparseEkf, Switch};

/// Values that depend on the length of a step, as a list of numbers, with which a filter changes to steps of another length.
impl<T: Scalar, S, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Returns the names of the numbers, for branch 0 `b0_…`. `b0_per_reach` is the inverse of `b0_reach`.
    #[must_use]
    pub fn step_names(&self) -> Vec<String> {
        let (mut names, mut branch) = (Vec::new(), 0);
        let mut step = self.step;
        let mut of_branch = false;
        step.visit(&mut |name, i, _| {
            // Every branch begins with its decay.
            (of_branch, branch) = match (name, of_branch) {
                ("decay", true) => (true, branch + 1),
                ("decay", false) => (true, 0),
                _ => (of_branch, branch),
            };
            names.push(if of_branch { std::format!("b{branch}_{name}_{i}") } else { std::format!("{name}_{i}") });
        });
        names
    }

    /// Returns the numbers.
    #[must_use]
    pub fn step_numbers(&self) -> Vec<T> {
        let (mut numbers, mut step) = (Vec::new(), self.step);
        step.visit(&mut |_, _, number| numbers.push(*number));
        numbers
    }

    /// Changes to steps of `dt_s` seconds with the given numbers.
    pub fn set_step(&mut self, dt_s: T, numbers: &[T]) {
        let mut numbers = numbers.iter();
        self.step.visit(&mut |_, _, number| *number = numbers.next().copied().unwrap_or(*number));
        self.dt_s = dt_s;
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> SignSplit<T, B, N, K, S, G> {
    /// See [`SparseEkf::set_step`]; also takes the probabilities of a change of phase, `[from][to]`.
    pub fn set_step(&mut self, dt_s: T, numbers: &[T], chain: [[T; 3]; 3]) {
        self.kernel.set_step(dt_s, numbers);
        self.chain = self.chain.map(|_| chain);
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> Hypotheses<T, B, N, K, S, G> {
    /// See [`SparseEkf::set_step`]; also takes the probabilities of a change of phase, `[from][to]`.
    pub fn set_step(&mut self, dt_s: T, numbers: &[T], chain: [[T; 3]; 3]) {
        self.kernel.set_step(dt_s, numbers);
        self.chain = chain;
    }
}
