use ohmstrain_model::Scalar;

use crate::{Advanced, Estimator, Innovation, Reading, StepError};

/// An estimator that divides a long step into several short ones.
///
/// The estimator determines the longest step ([`Estimator::longest_step_s`]); the steps of a long pause grow with it
/// ([`Pause`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substeps<E>(pub E);

/// The prepared steps of a pause: whole steps, and `count` last steps of equal length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeated<P, T> {
    before: Pause<T>,
    count: u32,
    last: P,
    last_count: u8,
}

impl<P, T: Copy> Repeated<P, T> {
    /// Returns the pause that it covers, with lengths merged by the estimator.
    pub const fn pause(&self) -> Pause<T> {
        self.before
    }
}

/// Tolerance for rounding, so that a step of the longest length remains one step.
pub const GRACE: f64 = 1.0005;
/// Largest pause, in longest steps, that is divided evenly.
pub const EVENLY: f64 = 4.0;
/// Largest step longer than the longest length, as a fraction of the time passed in the pause. Steps of 2 s within the first minute
/// left an error of half a standard deviation in the branches' mean.
const SHARE: f64 = 1.0 / 64.0;
/// Growth factor of steps, which yields few lengths, so that a program can tabulate them.
pub const GROWTH: f64 = 4.0;
/// Longest pause that is divided, s: twelve days. A longer one leaves no more information.
pub const LONGEST_PAUSE_S: f64 = 1_048_576.0;

/// Time since the last reading, divided into steps.
///
/// The division depends only on that time: 256 steps of the longest length L, then 192 of 4 L, of 16 L and so on. The remainder is
/// divided into the same lengths, the longest first, and a few equal steps of at most L. A pause may therefore be one row, or many
/// rows without a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "UncheckedPause<T>", bound(deserialize = "T: Scalar + serde::Deserialize<'de>"))
)]
pub struct Pause<T> {
    /// Longest length L, s.
    longest_s: T,
    /// Time passed in whole steps, in units of L.
    passed: T,
    /// Time since then, s.
    ahead_s: T,
}

/// A [`Pause`] as it was stored.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct UncheckedPause<T> {
    longest_s: T,
    passed: T,
    ahead_s: T,
}

#[cfg(feature = "serde")]
impl<T: Scalar> TryFrom<UncheckedPause<T>> for Pause<T> {
    type Error = &'static str;

    /// Refuses times that no number of steps covers.
    fn try_from(stored: UncheckedPause<T>) -> Result<Self, &'static str> {
        let UncheckedPause { longest_s, passed, ahead_s } = stored;
        let is_time = |time: T| time >= T::zero() && time.is_finite();
        if longest_s > T::zero() && is_time(passed) && is_time(ahead_s) {
            Ok(Self { longest_s, passed, ahead_s })
        } else {
            Err("expected the times of a pause")
        }
    }
}

/// True if a pause takes one step.
pub(crate) fn is_one_step<T: Scalar>(dt_s: T, longest_s: T) -> bool {
    dt_s <= longest_s * T::of(GRACE)
}

impl<T: Scalar> Pause<T> {
    /// Starts a pause at a reading, for an estimator whose longest step is `longest_s`.
    #[must_use]
    pub fn none(longest_s: T) -> Self {
        Self { longest_s, passed: T::zero(), ahead_s: T::zero() }
    }

    /// Returns the pause `dt_s` seconds later.
    #[must_use]
    pub fn after(self, dt_s: T) -> Self {
        let (ahead_s, most) = (self.ahead_s + dt_s, T::of(LONGEST_PAUSE_S));
        let is_too_long = ahead_s > most && self.longest_s.is_finite();
        Self { ahead_s: if is_too_long { most } else { ahead_s }, ..self }
    }

    /// Returns the time not yet passed in whole steps, s.
    pub const fn ahead_s(&self) -> T
    where
        T: Copy,
    {
        self.ahead_s
    }

    /// Passes a whole step, and returns its length, s; `None` if less than that is ahead.
    pub fn whole_step(&mut self) -> Option<T> {
        let times = self.times();
        self.exceeds(times).then(|| self.pass(times))
    }

    /// Passes a step of the remainder, and returns its length, s; `None` if only the even ones are ahead.
    pub(crate) fn step_before_last(&mut self) -> Option<T> {
        let mut times = self.times();
        while !self.exceeds(times) {
            if !(times > T::one()) {
                return None;
            }
            times *= T::of(1.0 / GROWTH);
        }
        Some(self.pass(times))
    }

    /// Returns the number of even steps, and their length, s.
    #[must_use]
    pub fn last_steps(&self) -> (u8, T) {
        let (mut count, mut counted) = (1, T::one());
        let more = self.longest_s * T::of(GRACE);
        let mut covered = more;
        // Counted in two types, because a conversion would need double precision.
        while covered < self.ahead_s && counted < T::of(EVENLY) {
            covered += more;
            count += 1;
            counted += T::one();
        }
        (count, self.ahead_s / counted)
    }

    /// Returns the lengths of all steps ahead, s.
    pub(crate) fn steps(mut self) -> impl Iterator<Item = T> {
        let mut even = None;
        core::iter::from_fn(move || {
            if even.is_none()
                && let Some(length_s) = self.step_before_last()
            {
                return Some(length_s);
            }
            let (left, length_s) = even.get_or_insert_with(|| self.last_steps());
            *left = left.checked_sub(1)?;
            Some(*length_s)
        })
    }

    /// True if more is ahead than a step of `times` L or, for the longest length itself, than the even steps.
    fn exceeds(&self, times: T) -> bool {
        let least = if times > T::one() { times } else { T::of(EVENLY) };
        self.ahead_s > least * self.longest_s * T::of(GRACE)
    }

    /// Returns the length of a whole step, in units of L.
    fn times(&self) -> T {
        let (mut times, growth) = (T::one(), T::of(GROWTH));
        while times * growth <= self.passed * T::of(SHARE) {
            times *= growth;
        }
        times
    }

    fn pass(&mut self, times: T) -> T {
        let step_s = times * self.longest_s;
        self.passed += times;
        self.ahead_s -= step_s;
        step_s
    }
}

impl<E> Substeps<E> {
    /// Starts a pause at a reading.
    pub fn pause<T, const N: usize, const L: usize>(&self) -> Pause<T>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        Pause::none(self.0.longest_step_s())
    }

    /// Returns a pause without whole steps, with a length merged by the estimator ([`Estimator::length_s`]).
    pub fn with_merged_length<T, const N: usize, const L: usize>(&self, pause: Pause<T>) -> Pause<T>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        let has_whole = !pause.passed.is_zero() || pause.exceeds(T::one());
        if has_whole { pause } else { Pause { ahead_s: self.0.length_s(pause.ahead_s), ..pause } }
    }

    /// Prepares the steps ahead in a pause.
    pub fn prepare_over<T, const N: usize, const L: usize>(&self, pause: Pause<T>) -> Repeated<E::Prepared, T>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        let pause = self.with_merged_length(pause);
        if is_one_step(pause.ahead_s, pause.longest_s) {
            return Repeated { before: pause, count: 0, last: self.0.prepare(pause.ahead_s), last_count: 1 };
        }
        let (mut end, mut count) = (pause, 0);
        while end.step_before_last().is_some() {
            count += 1;
        }
        let (last_count, length_s) = end.last_steps();
        Repeated { before: pause, count, last: self.0.prepare(length_s), last_count }
    }

    /// Prepares the whole steps of a pause, for a smoother; `None` if there are none.
    pub fn prepare_whole<T, const N: usize, const L: usize>(&self, pause: Pause<T>) -> Option<Repeated<E::Prepared, T>>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        let (mut end, mut count, mut last_s) = (pause, 0, None);
        while let Some(length_s) = end.whole_step() {
            (last_s, count) = (Some(length_s), count + 1);
        }
        let last = self.0.prepare(last_s?);
        Some(Repeated { before: pause, count: count - 1, last, last_count: 1 })
    }

    /// Passes the whole steps of a pause.
    ///
    /// # Errors
    /// See [`StepError`].
    pub fn pass_whole<T, const N: usize, const L: usize>(
        &self,
        state: &mut E::State,
        pause: &mut Pause<T>,
    ) -> Result<(), StepError>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        self.predict_over(state, core::iter::from_fn(|| pause.whole_step()))
    }

    /// Predicts over steps of these lengths, s.
    fn predict_over<T, const N: usize, const L: usize>(
        &self,
        state: &mut E::State,
        lengths_s: impl Iterator<Item = T>,
    ) -> Result<(), StepError>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        let mut prepared = None;
        for length_s in lengths_s {
            let step = match prepared {
                Some((last_s, step)) if last_s == length_s => step,
                _ => self.0.prepare(length_s),
            };
            prepared = Some((length_s, step));
            *state = self.0.advance(state, &step, None)?.state;
        }
        Ok(())
    }

    /// Smooths backwards over the remaining steps.
    fn smooth_back_over<T, const N: usize, const L: usize>(
        &self,
        filtered: &E::State,
        prepared: &Repeated<E::Prepared, T>,
        reading: Option<Reading<T>>,
        next: &E::State,
    ) -> Result<E::State, StepError>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        if prepared.count == 0 {
            if prepared.last_count <= 1 {
                return self.0.smooth_back(filtered, &prepared.last, reading, next);
            }
            let half = prepared.last_count / 2;
            let [sooner, later] =
                [half, prepared.last_count - half].map(|last_count| Repeated { last_count, ..*prepared });
            let middle = self.advance(filtered, &sooner, None)?.state;
            let between = self.smooth_back_over(&middle, &later, reading, next)?;
            return self.smooth_back_over(filtered, &sooner, None, &between);
        }
        // The first half forward, the rest backward, then the first half backward, so that few states are held at a
        // time.
        let first = prepared.count.div_ceil(2);
        let (mut middle, mut rest, mut last_s) = (filtered.clone(), prepared.before, T::zero());
        let mut left = first;
        let lengths = core::iter::from_fn(|| {
            left = left.checked_sub(1)?;
            rest.step_before_last().inspect(|length_s| last_s = *length_s)
        });
        self.predict_over(&mut middle, lengths)?;
        let later = Repeated { before: rest, count: prepared.count - first, ..*prepared };
        let later = self.smooth_back_over(&middle, &later, reading, next)?;
        let sooner = Repeated { count: first - 1, last: self.0.prepare(last_s), last_count: 1, ..*prepared };
        self.smooth_back_over(filtered, &sooner, None, &later)
    }
}

impl<T, E, const N: usize, const L: usize> Estimator<T, N, L> for Substeps<E>
where
    T: Scalar,
    E: Estimator<T, N, L>,
{
    type State = E::State;
    type Prepared = Repeated<E::Prepared, T>;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        self.prepare_over(self.pause().after(dt_s))
    }

    fn advance(
        &self,
        state: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<E::State, T>, StepError> {
        let mut next = state.clone();
        let innovation = self.advance_into(state, prepared, reading, &mut next)?;
        Ok(Advanced { state: next, innovation })
    }

    fn advance_into(
        &self,
        state: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
        next: &mut E::State,
    ) -> Result<Option<Innovation<T>>, StepError> {
        if prepared.count == 0 && prepared.last_count <= 1 {
            return self.0.advance_into(state, &prepared.last, reading, next);
        }
        let (mut between, mut before) = (state.clone(), prepared.before);
        self.predict_over(&mut between, core::iter::from_fn(|| before.step_before_last()))?;
        for _ in 1..prepared.last_count {
            between = self.0.advance(&between, &prepared.last, None)?.state;
        }
        self.0.advance_into(&between, &prepared.last, reading, next)
    }

    fn smooth_back(
        &self,
        filtered: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
        next: &E::State,
    ) -> Result<E::State, StepError> {
        self.smooth_back_over(filtered, prepared, reading, next)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::{GROWTH, LONGEST_PAUSE_S, Pause};

    /// Returns the lengths of all steps of a pause, in L, including the last one.
    fn lengths(pause: Pause<f64>) -> Vec<f64> {
        pause.steps().map(|length_s| length_s / pause.longest_s).collect()
    }

    #[test]
    fn a_long_step_is_divided_into_as_many_as_it_takes() {
        for (dt_s, expected) in
            [(0.0, 1), (0.01, 1), (0.1, 1), (0.1001, 2), (0.1 + 0.1 + 0.1, 3), (0.95, 10), (3.2, 32)]
        {
            let lengths = lengths(Pause::none(0.1).after(dt_s));
            assert_eq!(lengths.len(), expected, "{dt_s} s");
            assert!((lengths.iter().sum::<f64>() * 0.1 - dt_s).abs() < 1e-9);
        }
        assert_eq!(lengths(Pause::none(f64::INFINITY).after(1e5)).len(), 1);
        // 256 steps of length L, 192 of each longer length, and at most three of each in the remainder.
        let most = |seconds: f64| 260.0 + 195.0 * (seconds / 0.1 / 256.0).log(GROWTH).ceil().max(0.0) + 1.0;
        for seconds in [60.0, 3600.0, 86_400.0, LONGEST_PAUSE_S] {
            let found = lengths(Pause::none(0.1).after(seconds));
            assert!(found.len() as f64 <= most(seconds), "{seconds} s: {}", found.len());
            let mut passed = 0.0;
            for length in &found {
                assert!(*length <= 1.0005 || *length <= passed / 64.0, "{seconds} s: {length} after {passed}");
                passed += length;
            }
            assert!((passed * 0.1 / seconds - 1.0).abs() < 1e-9);
        }
        assert_eq!(lengths(Pause::none(0.1).after(f64::MAX)), lengths(Pause::none(0.1).after(LONGEST_PAUSE_S)));
    }

    /// Many rows take the same steps as one.
    #[test]
    fn a_pause_is_divided_alike_however_it_is_written_down() {
        for seconds in [0.05, 0.31, 7.0, 123.4, 5000.0] {
            for rows in [1, 3, 100] {
                let (mut pause, mut whole) = (Pause::none(0.125), Vec::new());
                for _ in 0..rows {
                    pause = pause.after(seconds / f64::from(rows));
                    whole.extend(core::iter::from_fn(|| pause.whole_step()).map(|length_s| length_s / 0.125));
                }
                whole.extend(lengths(pause));
                let at_once = lengths(Pause::none(0.125).after(seconds));
                assert_eq!(whole.len(), at_once.len(), "{seconds} s in {rows} rows");
                let apart = whole.iter().zip(&at_once).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-9, "{seconds} s in {rows} rows: {apart}");
            }
        }
    }
}
