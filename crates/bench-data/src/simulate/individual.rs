use rand_chacha::ChaCha8Rng;

use super::noise::{Stream, normal, random};

/// Spread of R₀ between sensors of one make: standard deviation of its logarithm.
pub(super) const REST_SPREAD: f64 = 0.2;
/// Spread of a sensor's character between sensors of one make. Illustrative: hand-made sensors of one batch differ by about this much.
pub(super) const CHARACTER_SPREAD: f64 = 0.15;

/// One sensor of a make.
pub(super) struct Individual(Option<ChaCha8Rng>);

impl Individual {
    pub(super) fn new(seed: Option<u64>) -> Self {
        Self(seed.map(|seed| random(seed, Stream::Individual)))
    }

    /// Returns the factor on the make's next number: log-normal with this spread, 1 for the make itself.
    pub(super) fn factor(&mut self, spread: f64) -> f64 {
        self.0.as_mut().map_or(1.0, |random| (spread * normal(random)).exp())
    }
}
