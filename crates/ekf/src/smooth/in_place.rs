//! Smoothing in place, from the filtered beliefs alone: the steps between them are taken again.
//!
//! What later readings say of a state is carried backwards as a vector λ and a matrix Λ, with which the smoothed belief is
//! `x̂ - P λ` and `P - P Λ P`. No matrix is inverted, and an exactly known state is nothing special.
//!
//! Source: Bierman, *Automatica* 9 (1973) 343; Bryson and Frazier, 1963.

use ohmstrain_model::{Scalar, Symmetric};

use crate::kernel::{Compared, Course, Driven, Parts};
use crate::{Belief, Curve, Reading, SparseEkf, StepError, Switch};

/// What later readings say of a state; of Λ the lower triangle is used.
#[derive(Clone, Copy)]
struct Ahead<T, const N: usize> {
    vector: [T; N],
    matrix: [[T; N]; N],
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Smooths what [`Self::filter`] has filtered: `beliefs[k]`, the belief after reading k, becomes the one given all
    /// readings. `readings` are those that the filter has taken, as many as beliefs; where they are fewer, the beliefs
    /// beyond stay as they are, and are not heeded.
    ///
    /// It is the fixed-interval smoother of the filter that was run, as [`rts_step`](crate::rts_step) after [`rts_step`](crate::rts_step),
    /// in 8 N (N + 3)/2 bytes a belief of `f64`.
    ///
    /// # Errors
    /// [`StepError::NonFiniteState`] if a smoothed belief is not finite or has a negative variance; later ones are smoothed
    /// by then, this one and those before it are as they were.
    pub fn smooth<const L: usize>(
        &self,
        readings: &[Option<Reading<T>>],
        beliefs: &mut [Belief<T, N, L>],
    ) -> Result<(), StepError> {
        let mut ahead = Ahead { vector: [T::zero(); N], matrix: [[T::zero(); N]; N] };
        // The last belief has no reading after it: it is smoothed already.
        let count = readings.len().min(beliefs.len());
        let steps = readings.iter().take(count).skip(1);
        for (reading, belief) in steps.zip(beliefs.iter_mut()).rev() {
            let mut parts = Parts::of(belief);
            let (spread, driven) = self.move_on::<T, S>(&mut parts, Course::Uncertain);
            if let Some(reading) = *reading {
                ahead.take(&self.compare(&parts, reading, None, spread), Self::HAS_BASELINE);
            }
            self.carry_back(&mut ahead, &driven);
            ahead.smooth(belief)?;
        }
        Ok(())
    }

    /// `Fᵀ λ` and `Fᵀ Λ F`.
    #[inline(always)]
    fn carry_back(&self, ahead: &mut Ahead<T, N>, driven: &[Driven<T>; B]) {
        let [a, b] = self.step.motion;
        // The two columns of F that are not diagonal.
        let columns: [[T; N]; 2] = core::array::from_fn(|j| {
            let mut column = [T::zero(); N];
            column[0] = a[j];
            column[1] = b[j];
            for (entry, driven) in column[2..].iter_mut().zip(driven) {
                *entry = driven.row[j] + driven.pull * a[j];
            }
            column
        });
        let mut decays = [T::zero(); N];
        for (decay, branch) in decays[2..].iter_mut().zip(&self.step.branches) {
            *decay = branch.decay;
        }
        if Self::HAS_BASELINE {
            decays[N - 1] = self.step.baseline_decay;
        }
        let old = *ahead;
        let entry = |i: usize, j: usize| if i < j { old.matrix[j][i] } else { old.matrix[i][j] };
        let dot = |x: &[T; N], y: &[T; N]| (0..N).fold(T::zero(), |sum, i| sum + x[i] * y[i]);
        let products: [[T; N]; 2] = core::array::from_fn(|j| {
            core::array::from_fn(|i| (0..N).fold(T::zero(), |sum, k| sum + entry(i, k) * columns[j][k]))
        });
        for i in 0..N {
            for j in 0..=i {
                ahead.matrix[i][j] = match (i < 2, j < 2) {
                    (true, _) => dot(&columns[i], &products[j]),
                    (false, true) => decays[i] * products[j][i],
                    (false, false) => decays[i] * decays[j] * old.matrix[i][j],
                };
            }
            ahead.vector[i] = if i < 2 { dot(&columns[i], &old.vector) } else { decays[i] * old.vector[i] };
        }
    }
}

impl<T: Scalar, const N: usize> Ahead<T, N> {
    /// Adds what a reading says: `(I - K H)ᵀ λ - Hᵀ ν/S` and `(I - K H)ᵀ Λ (I - K H) + Hᵀ H/S`.
    #[inline(always)]
    fn take<const B: usize>(&mut self, compared: &Compared<T, B>, has_baseline: bool) {
        let per_variance = T::one() / compared.variance;
        let mut gradient = [T::one(); N];
        gradient[0] = compared.slope;
        gradient[1] = compared.viscosity;
        let mut gain = [T::zero(); N];
        gain[0] = compared.strain * per_variance;
        gain[1] = compared.rate * per_variance;
        for (gain, branch) in gain[2..].iter_mut().zip(&compared.branches) {
            *gain = *branch * per_variance;
        }
        if has_baseline {
            gain[N - 1] = compared.baseline * per_variance;
        }
        let mut along = T::zero();
        let mut turned = [T::zero(); N];
        for i in 0..N {
            along += gain[i] * self.vector[i];
            for j in 0..N {
                turned[i] += if i < j { self.matrix[j][i] } else { self.matrix[i][j] } * gain[j];
            }
        }
        let push = along + compared.innovation * per_variance;
        let half = T::of(0.5) * (0..N).fold(per_variance, |sum, i| sum + gain[i] * turned[i]);
        for i in 0..N {
            self.vector[i] -= gradient[i] * push;
            turned[i] -= half * gradient[i];
        }
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] -= gradient[i] * turned[j] + turned[i] * gradient[j];
            }
        }
    }

    /// `x̂ - P λ` and `P - P Λ P`.
    #[inline(always)]
    fn smooth<const L: usize>(&self, belief: &mut Belief<T, N, L>) -> Result<(), StepError> {
        let mut p = [[T::zero(); N]; N];
        let mut entries = belief.covariance.packed().iter();
        for i in 0..N {
            for j in 0..=i {
                let entry = entries.next().copied().unwrap_or_else(T::zero);
                p[i][j] = entry;
                p[j][i] = entry;
            }
        }
        let mut turned = [[T::zero(); N]; N];
        for i in 0..N {
            for j in 0..N {
                for k in 0..N {
                    turned[i][j] += if i < k { self.matrix[k][i] } else { self.matrix[i][k] } * p[k][j];
                }
            }
        }
        let mut packed = [T::zero(); L];
        let mut places = packed.iter_mut();
        let mut mean = belief.mean;
        let (mut sum, mut positive) = (T::zero(), true);
        for i in 0..N {
            for k in 0..N {
                mean[i] -= p[i][k] * self.vector[k];
            }
            for j in 0..=i {
                let mut entry = p[i][j];
                for k in 0..N {
                    entry -= p[i][k] * turned[k][j];
                }
                positive = positive && (i != j || entry >= T::zero());
                if let Some(place) = places.next() {
                    *place = entry;
                }
                sum += entry;
            }
            sum += mean[i];
        }
        if !(positive && sum.is_finite()) {
            return Err(StepError::NonFiniteState);
        }
        belief.mean = mean;
        belief.covariance = Symmetric::from_packed(packed);
        Ok(())
    }
}
