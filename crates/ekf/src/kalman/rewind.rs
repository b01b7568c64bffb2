use ohmstrain_model::Scalar;

use super::{Filter, KalmanError, Normal};

/// Filter for readings that arrive late or out of order: it goes back to the time of a late reading, and takes the
/// later readings again.
///
/// `filter` builds the filter of a step from one time to another, s. The last CAPACITY readings are stored, each with
/// the state after it. An earlier reading is an error and changes nothing. A late reading costs one step for itself and
/// one for every later reading.
///
/// Source: Bar-Shalom, *IEEE TAES* 38 (2002) 769, where this is the optimal filter that others approximate.
#[derive(Clone, Copy, Debug)]
pub struct Rewind<T, B, const N: usize, const M: usize, const CAPACITY: usize> {
    filter: B,
    /// Time and state before the first stored reading.
    before: (T, Normal<T, N>),
    /// Stored readings in order of time; the first `count` are valid.
    past: [Past<T, N, M>; CAPACITY],
    count: usize,
}

/// A stored reading.
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

    /// Returns the time of the latest reading, and the state after it.
    #[must_use]
    pub fn latest(&self) -> (T, Normal<T, N>) {
        self.remembered().last().map_or(self.before, |last| (last.time_s, last.after))
    }

    /// Takes a reading of any time since the earliest stored one, and returns the state after the latest reading.
    /// Readings of the same time are taken in order of arrival.
    ///
    /// # Errors
    /// [`KalmanError::TimeOutOfReach`], or the error of a step. The filter is then unchanged.
    pub fn take(&mut self, time_s: T, reading: [Option<T>; M]) -> Result<Normal<T, N>, KalmanError> {
        if !(time_s >= self.before.0 && time_s.is_finite()) {
            return Err(KalmanError::TimeOutOfReach);
        }
        let late = Past { time_s, reading, after: self.before.1 };
        let place = self.remembered().iter().take_while(|past| past.time_s <= time_s).count();
        let is_full = self.count == CAPACITY;
        // The oldest reading is dropped, which may be the late one itself.
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

    /// Returns the state after a reading, given an earlier time and state.
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
