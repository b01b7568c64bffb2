use super::{INDUCING, Triangle};
use crate::kernel::{Falls, MOST_LANES, Several};
use crate::{Gaussian, Real, Recordable};

/// Weight of the linear part of the kernel, relative to the squared exponential.
pub const LINEAR: f64 = 0.09;

/// A Gaussian process conditioned on training rows with D inputs, with the kernel `exp(-Σ rᵢ (xᵢ - xᵢ')²) + 0.09 (x x' + 1)`:
/// rᵢ is the relevance of input i, and x the process' first input, all standardised.
///
/// Its mean uses all training rows. Its variance approximates their kernels by weighted sums of those of the first few,
/// the *inducing* rows (Nyström; Quiñonero-Candela & Rasmussen, *J. Mach. Learn. Res.* 6 (2005) 1939): it is larger
/// than with all kernels where these rows are far away, and much cheaper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Process<'a, T, const D: usize> {
    /// Relevance of each input, 1/2ℓ² with its length scale ℓ, in standard deviations of the input; 0 if it is not used.
    pub relevance: [T; D],
    /// Mean of the targets.
    pub mean: T,
    /// Weight of each training row, in the unit of the target.
    pub weights: &'a [T],
    /// W: for kernels k of the inducing rows, |W k|² is the part of the prior variance that the training rows explain.
    pub explained: Triangle<'a, T>,
    /// Prior variance of the process where the kernel is 1.
    pub variance: T,
    /// Variance of the unpredicted noise, white and correlated in time.
    pub noise: T,
    /// Factor on the variance, from held-out training rows.
    pub widening: T,
    /// Smallest prior variance of the process.
    pub least_variance: T,
}

impl<T: Recordable, const D: usize> Process<'_, T, D> {
    /// Returns the sum of the squared distances in each input, weighted by relevance relative to that of the input `first`.
    pub(crate) fn distance(&self, squares: &[T; D], first: usize) -> T {
        let sum = squares.iter().zip(&self.relevance).fold(T::zero(), |sum, (square, by)| sum + *square * *by);
        self.relevance.get(first).map_or(sum, |first| sum / *first)
    }

    /// Returns the process's prediction from the weighted sum of all kernels and the variance that the inducing rows
    /// explain; `first` is the first input.
    pub(crate) fn prediction(&self, mean: T, explained: T, first: T) -> Prediction<T> {
        let prior = T::one() + linear(first * first);
        let unknown = ((prior - explained) / prior).max(T::zero()).min(T::one());
        let latent = (prior * self.variance).max(self.least_variance) * unknown;
        Prediction { strain: Gaussian { mean, variance: latent + self.noise }, unknown }
    }
}

impl<T: Real, const D: usize> Process<'_, T, D> {
    /// Returns the kernels with rows, from their squared distances in each input from `first` on, and the product of that input.
    #[inline(always)]
    pub(crate) fn kernels<V: Falls<Number = T>>(&self, squares: &[V; D], first: usize, product: V) -> V {
        let mut distance = product.nothing();
        for i in first..D {
            distance += squares[i].scale(self.relevance[i]);
        }
        (-distance).falling() + (product + product.literal(1.0)).scale(T::of(LINEAR))
    }
}

/// Prediction of a process at one input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction<T> {
    pub strain: Gaussian<T>,
    /// Share of the prior variance that the training rows leave unexplained, 0 to 1.
    pub unknown: T,
}

/// Room for the inducing rows in whole vectors, for any alignment.
const ROOM: usize = INDUCING + MOST_LANES - 1;

/// Kernels with the training rows, row by row.
pub(super) struct Kernels<T> {
    mean: T,
    /// Kernels with the inducing rows, padded to whole vectors.
    inducing: [T; ROOM],
    rows: usize,
}

impl<T: Real> Kernels<T> {
    pub(super) fn new<const D: usize>(process: &Process<'_, T, D>) -> Self {
        Self { mean: process.mean, inducing: [T::zero(); ROOM], rows: 0 }
    }

    /// Adds the kernels of the next `count` training rows.
    #[inline(always)]
    pub(super) fn add<V: Several<Number = T>, const D: usize>(
        &mut self,
        process: &Process<'_, T, D>,
        kernel: V,
        count: usize,
    ) {
        let weights = process.weights.get(self.rows..self.rows + count).unwrap_or(&[]);
        let weighted = kernel.first_of(weights) * kernel;
        // One after the other, so that the sum does not depend on the number of lanes.
        for lane in 0..V::WIDTH {
            self.mean += weighted.at(lane);
        }
        if let Some(places) = self.inducing.get_mut(self.rows..self.rows + V::WIDTH) {
            kernel.put_into(places);
        }
        self.rows += count;
    }

    /// Returns the process's prediction; `first` is the first input.
    #[inline(always)]
    pub(super) fn prediction<V: Several<Number = T>, const D: usize>(
        &self,
        like: V,
        process: &Process<'_, T, D>,
        first: T,
    ) -> Prediction<T> {
        process.prediction(self.mean, process.explained.square(like, &self.inducing), first)
    }
}

/// Returns the kernel of two rows from the sum `Σ rᵢ (xᵢ - xᵢ')²` and the product of their first inputs.
#[must_use]
pub fn kernel<T: Real>(sum: T, product: T) -> T {
    (-sum).exp() + linear(product)
}

fn linear<T: Recordable>(product: T) -> T {
    T::of(LINEAR) * (product + T::one())
}
