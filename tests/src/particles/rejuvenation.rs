use ohmstrain_model::{Phase, Scalar};

use crate::particles::cloud::{Chance, Particle, root_columns, weighted_moments};

/// Width of the kernel, in standard deviations of the cloud; its shrinkage a = √(1 - h²) is 0.995, which is Liu and
/// West's discount factor (3δ - 1)/(2δ) at δ = 0.99.
const REACH: f64 = 0.1;

/// Spreads copies of resting particles, which result from resampling.
///
/// In a hold, strains do not move. Each resampling leaves fewer distinct ones, until a single one is left and the cloud
/// is certain of it. Therefore every resting particle x is redrawn from a normal kernel around a point slightly nearer
/// to the mean m of its group,
///
/// `x' = m + a (x - m) + h n`, n ~ N(0, V), `a² + h² = 1`,
///
/// which preserves the group's mean and covariance: `E[x'] = m + a (E[x] - m) = m` and `Cov[x'] = a² V + h² V = V`. V
/// is the covariance of the whole state, so branches and baseline move with the strain as the readings have correlated
/// them: their means fall as g(ε) rises, with the same gains in every particle, and V is narrow across that line.
///
/// A group is the resting particles on one side of `border`, the static border. A common mean of both sides would pull
/// the two strains compatible with a reading toward the strain between them, which is not.
///
/// Source: Liu & West in *Sequential Monte Carlo Methods in Practice* (2001), ch. 10.
pub(crate) fn rejuvenate<T: Scalar, const N: usize, const L: usize>(
    particles: &mut [Particle<T, N>],
    border: Option<T>,
    chance: &mut Chance,
) {
    for beyond in [false, true] {
        let is_beyond = |p: &Particle<T, N>| border.is_some_and(|border| p.state[0] > border);
        let mut group: Vec<&mut Particle<T, N>> =
            particles.iter_mut().filter(|p| p.phase == Phase::Hold && is_beyond(p) == beyond).collect();
        spread::<T, N, L>(&mut group, chance);
    }
}

/// Redraws each particle of an equally weighted group from its kernel.
fn spread<T: Scalar, const N: usize, const L: usize>(group: &mut [&mut Particle<T, N>], chance: &mut Chance) {
    if group.len() <= N {
        return; // fewer points than a covariance has directions
    }
    let weight = T::one() / T::of(group.len() as f64);
    let (mean, covariance) = weighted_moments::<T, N, L>(group.iter().map(|p| (weight, &p.state)));
    let columns = root_columns(&covariance);
    let reach = T::of(REACH);
    let kept = (T::one() - reach * reach).sqrt();
    for particle in group {
        particle.state = mean + (particle.state - mean) * kept + chance.combine(&columns) * reach;
    }
}
