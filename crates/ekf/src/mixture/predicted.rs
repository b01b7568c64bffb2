use ohmstrain_model::Scalar;

/// The reading compared with all its predictions. Innovations are summed relative to the first one, so that their spread is
/// not a small difference of two squared distances to the reading.
#[derive(Clone, Copy)]
pub(crate) struct Predicted<T> {
    weight: T,
    around: T,
    distance: T,
    square: T,
    variance: T,
}

impl<T: Scalar> Predicted<T> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        let zero = T::zero();
        Self { weight: zero, around: zero, distance: zero, square: zero, variance: zero }
    }

    /// Adds a hypothesis of probability `weight`, with its innovation and innovation variance.
    #[inline(always)]
    pub(crate) fn add(&mut self, weight: T, innovation: T, variance: T) {
        if self.weight.is_zero() {
            self.around = innovation;
        }
        let distance = innovation - self.around;
        self.weight += weight;
        self.distance += weight * distance;
        self.square += weight * distance * distance;
        self.variance += weight * variance;
    }

    /// Returns the total probability.
    pub(crate) const fn weight(&self) -> &T {
        &self.weight
    }

    /// Returns mean and variance of the innovation.
    pub(crate) fn moments(&self) -> (T, T) {
        let mean = self.distance / self.weight;
        let spread = (self.square / self.weight - mean * mean).max(T::zero());
        (self.around + mean, self.variance / self.weight + spread)
    }
}

#[cfg(test)]
mod tests {
    use super::Predicted;

    /// Mean `Σ w ν / Σ w` and variance `Σ w (S + ν²) / Σ w - mean²`, exact at this distance from the reading; and in `f32`
    /// at a distance at which these squares lose the whole variance.
    #[test]
    fn the_innovation_of_a_mixture_has_its_moments() {
        let parts = [(0.2, 1.0, 0.5), (0.1, -2.0, 0.3), (0.4, 0.25, 0.7)];
        let mut predicted = Predicted::new();
        parts.iter().for_each(|(weight, innovation, variance)| predicted.add(*weight, *innovation, *variance));
        let sum = |of: fn(f64, f64, f64) -> f64| parts.iter().map(|(w, nu, s)| of(*w, *nu, *s)).sum::<f64>();
        let total = sum(|w, _, _| w);
        let mean = sum(|w, nu, _| w * nu) / total;
        let variance = sum(|w, nu, s| w * (s + nu * nu)) / total - mean * mean;
        let found = predicted.moments();
        assert!((found.0 - mean).abs() < 1e-15 && (found.1 - variance).abs() < 1e-15, "{found:?} {mean} {variance}");
        let mut far = Predicted::<f32>::new();
        far.add(0.5, 3e4, 1e-4);
        far.add(0.5, 3e4 + 0.25, 1e-4);
        // A quarter is a multiple of the rounding unit there, so nothing is rounded.
        assert_eq!(far.moments(), (30_000.125, 1e-4 + 0.015_625));
    }
}
