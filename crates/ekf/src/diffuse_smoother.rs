use core::fmt;

use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Scalar, Transition};

use crate::diffuse_belief::negligible;
use crate::ekf::joseph;
use crate::psd::SemiDefinite;
use crate::{Belief, DiffuseBelief, DiffuseStep, rts_step};

/// The readings say nothing about some direction of the state at a step, so there is no smoothed belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undetermined {
    /// Index of the step.
    pub step: usize,
}

impl fmt::Display for Undetermined {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "all readings together leave the state at step {} undetermined", self.step)
    }
}

impl core::error::Error for Undetermined {}

/// One step backwards of the Rauch-Tung-Striebel smoother from a diffuse belief.
///
/// - `filtered`: belief at time k from the readings up to k.
/// - `transition`: how it led to time k+1; the stored linearisation.
/// - `smoothed_next`: belief at k+1 from all readings.
///
/// Returns the belief at k from all readings, or `None` if even the state at k+1 would leave it undetermined.
///
/// The state at k+1 is a reading of the state at k with noise covariance Q. After L D Lᵀ of Q its components are
/// scalar readings, and the diffuse update is exact for those. What results, a gain G and the covariance C of the state
/// at k given the one at k+1, makes the smoothed covariance `C + G Pˢ Gᵀ`: a sum, positive semi-definite under rounding,
/// where the recursions with r₀, r₁, N₀, N₁, N₂ of Durbin & Koopman (2012), 5.3, which say the same, subtract.
#[allow(non_snake_case, reason = "F, P, G, K, S are the letters of every textbook; NOTATION.md has the table")]
#[must_use]
pub fn diffuse_rts_step<T: Scalar, const N: usize, const L: usize>(
    filtered: &DiffuseBelief<T, N, L>,
    transition: &Transition<T, N, L>,
    smoothed_next: &Belief<T, N, L>,
) -> Option<Belief<T, N, L>> {
    let noise = SemiDefinite::factor(&transition.noise);
    let rows = noise.whiten(&transition.jacobian);
    let mut given = *filtered;
    let mut G = SMatrix::<T, N, N>::zeros();
    let mut spread = SVector::<T, N>::zeros();
    for i in 0..N {
        let (H, R) = (rows.row(i).transpose(), noise.pivot(i));
        let P = given.finite.covariance;
        for k in 0..N {
            spread[k] = spread[k].max(P[(k, k)].max(T::zero()).sqrt());
        }
        let PHt = P.mul(&H);
        let K = match given.fix_direction(&H) {
            Some((_, K)) => K,
            None => {
                let S = H.dot(&PHt) + R;
                let size = H.abs().dot(&spread);
                // Exactly known from the components before: what is left of the variance is rounding.
                if !(S > size * size * negligible::<T, N>()) {
                    continue;
                }
                PHt / S
            }
        };
        given.finite.covariance = joseph(&P, &PHt, &K, &H, R);
        let mut innovation = -H.transpose() * G;
        innovation[i] += T::one();
        G += K * innovation;
    }
    let conditional = given.settled()?.covariance;
    let G = G * noise.whiten(&SMatrix::identity());
    let mean = filtered.finite.mean + G * (smoothed_next.mean - transition.mean);
    Some(Belief { mean, covariance: smoothed_next.covariance.congruence(&G).plus(&conditional) })
}

/// Smooths a recording from a diffuse start: `smoothed[k]` becomes the belief at the time of `steps[k]` given all
/// readings.
///
/// Writes as many beliefs as the shorter of both slices has; the last step of `steps` must be the last reading. Steps of
/// an ordinary filter after the start go in through [`DiffuseStep::from`].
///
/// # Errors
/// Names the last step that the readings leave undetermined; the beliefs after it are written.
pub fn diffuse_smooth<T: Scalar, const N: usize, const L: usize>(
    steps: &[DiffuseStep<T, N, L>],
    smoothed: &mut [Belief<T, N, L>],
) -> Result<(), Undetermined> {
    let mut next: Option<(&DiffuseStep<T, N, L>, Belief<T, N, L>)> = None;
    for (index, (step, out)) in steps.iter().zip(smoothed).enumerate().rev() {
        let belief = match (&next, step.posterior.settled()) {
            (None, settled) => settled,
            (Some((later, belief)), Some(settled)) => {
                Some(rts_step(&settled, &later.transition, &later.prior.finite, belief))
            }
            (Some((later, belief)), None) => diffuse_rts_step(&step.posterior, &later.transition, belief),
        };
        *out = belief.ok_or(Undetermined { step: index })?;
        next = Some((step, *out));
    }
    Ok(())
}
