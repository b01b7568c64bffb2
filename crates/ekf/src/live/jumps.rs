use crate::Recordable;

/// Normalised innovation squared above which a reading surprises: three standard deviations.
pub const SURPRISING_NIS: f64 = 9.0;
/// Normalised innovation squared above which a reading startles: five standard deviations.
const STARTLING_NIS: f64 = 25.0;
/// Number of startling readings in a row that triggers a second look.
const BESIDE_AFTER: f64 = 2.0;
/// Largest number of startling readings in a row that may be a spike.
const LONGEST_SPIKE: f64 = 3.0;
/// Weight that the initial distribution then gets.
pub const BESIDE_SHARE: f64 = 0.1;

/// Detector of jumps in the readings, which trigger a second look of the filter. A wrong law, for example on another day, surprises
/// without a jump; a second look would then discard what the filter has learned since.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Jumps<T> {
    /// Number of startling readings in a row; readings that the filter did not use are ignored.
    pub(crate) startling: T,
    /// The last reading that did not surprise.
    pub(crate) calm: Option<T>,
}

impl<T: Recordable> Jumps<T> {
    /// Starts before any reading.
    #[must_use]
    pub fn none() -> Self {
        Self { startling: T::zero(), calm: None }
    }

    /// Takes a reading used by the filter, and its normalised innovation squared. Returns the jump of the readings if the
    /// filter needs a second look: two in a row startle, the second farther than `jump` from the last that did not surprise.
    pub fn see(&mut self, reading: T, nis: T, jump: T) -> Option<T> {
        self.startling = if nis > T::of(STARTLING_NIS) { self.startling + T::one() } else { T::zero() };
        let from_calm = self.calm.map(|calm| reading - calm);
        self.calm = if nis > T::of(SURPRISING_NIS) { self.calm } else { Some(reading) };
        from_calm.filter(|moved| self.startling == T::of(BESIDE_AFTER) && moved.abs() > jump)
    }

    /// True if the last reading startled, and at most two before it in a row: a wrong law startles for longer than a spike.
    #[must_use]
    pub fn may_be_spike(&self) -> bool {
        self.startling > T::zero() && self.startling <= T::of(LONGEST_SPIKE)
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
