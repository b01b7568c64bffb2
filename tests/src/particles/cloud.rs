use nalgebra::SVector;
use ohmstrain_ekf::{Belief, State};
use ohmstrain_model::{Phase, Scalar, Symmetric};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// One sampled path of the motion up to now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle<T, const N: usize> {
    /// Probability; those of a cloud sum to one.
    pub weight: T,
    /// Current phase; in motion, the sign of the rate.
    pub phase: Phase,
    /// Sampled strain and its derivatives; means of branches and baseline given the path and the readings.
    pub state: SVector<T, N>,
}

/// Weighted paths of the motion, and the distribution of branches and baseline given a path.
///
/// It contains its random number generator, so that equal clouds give equal steps.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleCloud<T, const N: usize, const L: usize> {
    pub(crate) particles: Vec<Particle<T, N>>,
    /// Covariance of branches and baseline given the path: the same for every path, because neither the dynamics of
    /// that part of the state nor its contribution to a reading depends on the path. Rows of the motion are zero.
    pub(crate) covariance: Symmetric<T, N, L>,
    pub(crate) chance: Chance,
}

impl<T: Scalar, const N: usize, const L: usize> ParticleCloud<T, N, L> {
    /// The particles.
    #[must_use]
    pub fn particles(&self) -> &[Particle<T, N>] {
        &self.particles
    }

    /// Returns the Gaussian with the cloud's mean and covariance: the spread of the particles plus the covariance given
    /// a path.
    #[must_use]
    pub fn moments(&self) -> Belief<T, N, L> {
        let (mean, spread) = weighted_moments(self.particles.iter().map(|p| (p.weight, &p.state)));
        Belief { mean, covariance: self.covariance.plus(&spread) }
    }

    /// Probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        let mut probabilities = [T::zero(); 3];
        for particle in &self.particles {
            if let Some(probability) = probabilities.get_mut(particle.phase.index()) {
                *probability += particle.weight;
            }
        }
        probabilities
    }

    /// Effective sample size `1 / Σ w²`: the number of equally weighted particles with the same information.
    #[must_use]
    pub fn effective_count(&self) -> T {
        T::one() / self.particles.iter().fold(T::zero(), |sum, p| sum + p.weight * p.weight)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.covariance.is_finite()
            && self.particles.iter().all(|p| p.weight.is_finite() && p.state.iter().all(|x| x.is_finite()))
    }

    /// Replaces the particles by as many of equal weight (systematic resampling). One random number places a comb of
    /// equal spacing on the weights laid end to end, so that each particle is copied in proportion to its weight, to
    /// within one.
    ///
    /// Source: Kitagawa, *J. Comput. Graph. Stat.* 5 (1996) 1.
    pub(crate) fn resample(&mut self) {
        let count = T::of(self.particles.len() as f64);
        let mut kept = Vec::with_capacity(self.particles.len());
        let mut tooth: T = self.chance.uniform();
        let mut reached = T::zero();
        for particle in &self.particles {
            reached += particle.weight * count;
            while tooth < reached && kept.len() < self.particles.len() {
                kept.push(Particle { weight: T::one() / count, ..*particle });
                tooth += T::one();
            }
        }
        // Rounding may have left the sum of the weights short of the last tooth.
        while let (Some(last), true) = (kept.last().copied(), kept.len() < self.particles.len()) {
            kept.push(last);
        }
        self.particles = kept;
    }
}

impl<T: Scalar, const N: usize, const L: usize> State<T, N, L> for ParticleCloud<T, N, L> {
    fn moments(&self) -> Belief<T, N, L> {
        self.moments()
    }

    fn each(&self, visit: &mut dyn FnMut(T, &Belief<T, N, L>)) {
        for particle in &self.particles {
            visit(particle.weight, &Belief { mean: particle.state, covariance: self.covariance });
        }
    }

    fn phases(&self) -> Option<[T; 3]> {
        Some(self.phase_probabilities())
    }

    /// Moves the particles away from their mean: every deviation is multiplied by the square root of `factor`.
    fn inflated(&self, factor: T) -> Self {
        let mean = self.moments().mean;
        let mut inflated = self.clone();
        for particle in &mut inflated.particles {
            particle.state = mean + (particle.state - mean) * factor.sqrt();
        }
        inflated.covariance = inflated.covariance.scaled(factor);
        inflated
    }
}

/// Returns mean and covariance of weighted points; the weights sum to one.
pub(crate) fn weighted_moments<'a, T: Scalar, const N: usize, const L: usize>(
    points: impl Iterator<Item = (T, &'a SVector<T, N>)> + Clone,
) -> (SVector<T, N>, Symmetric<T, N, L>) {
    let mean = points.clone().fold(SVector::zeros(), |sum, (weight, point)| sum + point * weight);
    let mut covariance = Symmetric::zeros();
    for (weight, point) in points {
        covariance.add_outer(&(point - mean), weight);
    }
    (mean, covariance)
}

/// Source of random numbers: ChaCha with eight rounds, the same on every machine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chance(pub(crate) ChaCha8Rng);

impl Chance {
    /// Draws from the standard normal distribution.
    pub(crate) fn normal<T: Scalar>(&mut self) -> T {
        let draw: f64 = StandardNormal.sample(&mut self.0);
        T::of(draw)
    }

    /// Draws uniformly from 0 to 1.
    pub(crate) fn uniform<T: Scalar>(&mut self) -> T {
        let draw: f64 = StandardUniform.sample(&mut self.0);
        T::of(draw)
    }

    /// Returns the sum of these columns, each times a standard normal number. For the columns of a square root of a
    /// covariance, this is a draw with that covariance.
    pub(crate) fn combine<T: Scalar, const N: usize>(&mut self, columns: &[SVector<T, N>]) -> SVector<T, N> {
        columns.iter().fold(SVector::zeros(), |sum, column| sum + column * self.normal::<T>())
    }
}

/// Returns the columns of a square root `L √D` of a positive semi-definite matrix, `L D Lᵀ` with unit lower triangular L;
/// the rounding error of a zero pivot counts as zero.
pub(crate) fn root_columns<T: Scalar, const N: usize, const L: usize>(
    matrix: &Symmetric<T, N, L>,
) -> [SVector<T, N>; N] {
    let negligible = T::default_epsilon() * T::of(N as f64);
    let mut columns = [SVector::zeros(); N];
    for j in 0..N {
        let left = |i: usize, columns: &[SVector<T, N>; N]| {
            (0..j).fold(matrix[(i, j)], |left, k| left - columns[k][i] * columns[k][j])
        };
        let pivot = left(j, &columns);
        if pivot <= matrix[(j, j)].abs() * negligible {
            continue;
        }
        let root = pivot.sqrt();
        for i in j..N {
            columns[j][i] = left(i, &columns) / root;
        }
    }
    columns
}
