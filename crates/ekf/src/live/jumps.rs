use crate::Recordable;

/// Normalised innovation squared above which a reading surprises: three standard deviations.
pub const SURPRISING_NIS: f64 = 9.0;
/// Normalised innovation squared above which a reading startles: five standard deviations.
const STARTLING_NIS: f64 = 25.0;
/// Number of startling readings in a row after which a filter looks again.
const BESIDE_AFTER: f64 = 2.0;
/// Weight that the knowledge from before any reading then gets.
pub const BESIDE_SHARE: f64 = 0.1;

/// Detector of jumps in the readings, after which a filter looks again. A wrong law, on another day for example, surprises without a
/// jump: a filter that looked again then would lose what it has learned since.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Jumps<T> {
    /// Readings in a row that startled; those that were kept from the filter do not count.
    pub(crate) startling: T,
    /// The last one that did not surprise.
    pub(crate) calm: Option<T>,
}

impl<T: Recordable> Jumps<T> {
    /// Starts before any reading.
    #[must_use]
    pub fn none() -> Self {
        Self { startling: T::zero(), calm: None }
    }

    /// Takes a reading that the filter has used, and its normalised innovation squared; how far readings have jumped, where the
    /// filter is to look again: two in a row startle, farther than `jump` from the last that did not surprise.
    pub fn see(&mut self, reading: T, nis: T, jump: T) -> Option<T> {
        self.startling = if nis > T::of(STARTLING_NIS) { self.startling + T::one() } else { T::zero() };
        let from_calm = self.calm.map(|calm| reading - calm);
        self.calm = if nis > T::of(SURPRISING_NIS) { self.calm } else { Some(reading) };
        from_calm.filter(|moved| self.startling == T::of(BESIDE_AFTER) && moved.abs() > jump)
    }
}

#[cfg(test)]
mod tests {
    use super::Jumps;

    /// Feeds `readings` with their normalised innovations squared, and returns the jump after each.
    fn seen(readings: &[(f64, f64)]) -> Vec<Option<f64>> {
        let mut jumps = Jumps::none();
        readings.iter().map(|&(reading, nis)| jumps.see(reading, nis, 0.08)).collect()
    }

    extern crate std;
    use std::vec;
    use std::vec::Vec;

    #[test]
    fn two_startling_readings_that_are_far_from_the_last_calm_one_are_a_jump_once() {
        let jumped = seen(&[(0.5, 1.0), (0.7, 30.0), (0.75, 26.0), (0.75, 40.0), (0.75, 1.0)]);
        assert_eq!(jumped, vec![None, None, Some(0.25), None, None]);
        // Near, not startling enough, interrupted, and before any calm reading.
        for readings in [
            [(0.5, 1.0), (0.55, 30.0), (0.57, 30.0), (0.9, 1.0)],
            [(0.5, 1.0), (0.7, 24.0), (0.7, 24.0), (0.7, 24.0)],
            [(0.5, 1.0), (0.7, 30.0), (0.7, 20.0), (0.7, 30.0)],
            [(0.5, 30.0), (0.7, 30.0), (0.9, 30.0), (0.9, 30.0)],
        ] {
            assert_eq!(seen(&readings), vec![None; 4], "{readings:?}");
        }
    }
}
