use ohmstrain_model::Scalar;

use super::{Filter, KalmanError, Normal};

/// Filter for readings that arrive late or out of order: goes back to where a late reading belongs and takes the
/// later ones again.
///
/// `filter` makes the filter of a step from one time to another, s. The last CAPACITY readings are remembered, each with
/// the state after it. A reading from before them is an error and changes nothing. Cost: one step per reading that is
/// later than the one that comes.
///
/// Source: Bar-Shalom, *IEEE TAES* 38 (2002) 769, where this is the optimal filter that others approximate.
#[derive(Clone, Copy, Debug)]
pub struct Rewind<T, B, const N: usize, const M: usize, const CAPACITY: usize> {
    filter: B,
    /// Time and state before the first of those remembered.
    before: (T, Normal<T, N>),
    /// The first `count`, in the order of time.
    past: [Past<T, N, M>; CAPACITY],
    count: usize,
}

/// A reading that was taken.
#[derive(Clone, Copy, Debug)]
struct Past<T, const N: usize, const M: usize> {
    time_s: T,
    reading: [Option<T>; M],
    after: Normal<T, N>,
}

impl<T, B, F, const N: usize, const M: usize, const CAPACITY: usize> Rewind<T, B, N, M, CAPACITY>
where
    T: Scalar,
    B: Fn(T, T) -> F,
    F: Filter<T, N, M>,
{
    /// Starts from the state at a time.
    pub fn new(filter: B, time_s: T, start: Normal<T, N>) -> Self {
        let none = Past { time_s, reading: [None; M], after: start };
        Self { filter, before: (time_s, start), past: [none; CAPACITY], count: 0 }
    }

    /// The state after the latest reading, and its time.
    #[must_use]
    pub fn latest(&self) -> (T, Normal<T, N>) {
        self.remembered().last().map_or(self.before, |last| (last.time_s, last.after))
    }

    /// Takes a reading of any time since the earliest that is remembered. Of readings of one time the last to come is
    /// taken last. Returns the state after the latest reading.
    ///
    /// # Errors
    /// [`KalmanError::TimeOutOfReach`], or the error of a step. Nothing has changed then.
    pub fn take(&mut self, time_s: T, reading: [Option<T>; M]) -> Result<Normal<T, N>, KalmanError> {
        if !(time_s >= self.before.0 && time_s.is_finite()) {
            return Err(KalmanError::TimeOutOfReach);
        }
        let late = Past { time_s, reading, after: self.before.1 };
        let place = self.remembered().iter().take_while(|past| past.time_s <= time_s).count();
        let is_full = self.count == CAPACITY;
        // The oldest is forgotten; that may be the late one itself.
        let before = match (is_full, place) {
            (false, _) => self.before,
            (true, 0) => (time_s, self.after(self.before, &late)?),
            (true, _) => (self.past[0].time_s, self.past[0].after),
        };
        let forgotten = usize::from(is_full && place > 0);
        let slot = if is_full && place == 0 { CAPACITY } else { place - forgotten };
        let is_later = |i: usize| i > slot || slot == CAPACITY;
        let mut past = core::array::from_fn(|i| match i {
            _ if i == slot => late,
            _ if i > slot => self.past[i - 1 + forgotten],
            _ => self.past[(i + forgotten).min(CAPACITY - 1)],
        });
        let count = self.count + usize::from(!is_full);
        let mut from = before;
        for (i, past) in past.iter_mut().enumerate().take(count) {
            if i == slot || is_later(i) {
                past.after = self.after(from, past)?;
            }
            from = (past.time_s, past.after);
        }
        (self.before, self.past, self.count) = (before, past, count);
        Ok(from.1)
    }

    /// The state after a reading, from a time and the state then.
    fn after(&self, from: (T, Normal<T, N>), past: &Past<T, N, M>) -> Result<Normal<T, N>, KalmanError> {
        let filter = (self.filter)(from.0, past.time_s);
        let step = if past.time_s > from.0 {
            filter.step(&from.1, &past.reading)
        } else {
            filter.update(&from.1, &past.reading)
        };
        Ok(step?.posterior)
    }

    fn remembered(&self) -> &[Past<T, N, M>] {
        &self.past[..self.count]
    }
}
