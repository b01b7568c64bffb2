use nalgebra::SMatrix;
use ohmstrain_model::{Scalar, Transition};

use crate::Belief;
use crate::belief::psd::SemiDefinite;

/// Performs one backward step of the Rauch-Tung-Striebel smoother.
///
/// - `filtered`: belief at time k from the readings up to k.
/// - `transition`, `prior`: the transition to time k+1 and the prediction there; use the stored linearisation, not a new
///   one.
/// - `smoothed_next`: belief at k+1 from all readings.
///
/// Returns the belief at k from all readings. The covariance is the sum `(I - G F) P (I - G F)ᵀ + G (Q + Pˢ) Gᵀ`, which is
/// positive semi-definite under rounding. Exactly known states (a singular prior) are valid input.
///
/// A nearly singular prior is the hard case; branches without process noise lead to it. A direction with the remaining
/// share p of its variance makes G as large as 1/√p, and rounding enters the covariance as ε/p. Directions below p = ε^⅔
/// are therefore not smoothed. That costs p times the readings' signal-to-noise ratio, and keeps the error below about
/// N² ε^⅓.
///
/// Source: Rauch, Tung, Striebel, *AIAA J.* 3 (1965) 1445.
#[allow(non_snake_case, reason = "F, P, G, Q are the letters of every textbook; NOTATION.md has the table")]
#[must_use]
pub fn rts_step<T: Scalar, const N: usize, const L: usize>(
    filtered: &Belief<T, N, L>,
    transition: &Transition<T, N, L>,
    prior: &Belief<T, N, L>,
    smoothed_next: &Belief<T, N, L>,
) -> Belief<T, N, L> {
    let F = &transition.jacobian;
    let FP = F * filtered.covariance.to_matrix();
    let factor = SemiDefinite::factor_without(&prior.covariance, T::default_epsilon().powf(T::of(2.0 / 3.0)));
    let mut G = SMatrix::<T, N, N>::zeros();
    for i in 0..N {
        G.set_row(i, &factor.solve(&FP.column(i).into_owned()).transpose());
    }
    let mean = filtered.mean + G * (smoothed_next.mean - prior.mean);
    let I_GF = SMatrix::identity() - G * F;
    let ahead = transition.noise.plus(&smoothed_next.covariance).congruence(&G);
    Belief { mean, covariance: filtered.covariance.congruence(&I_GF).plus(&ahead) }
}
