use std::collections::HashMap;

use ohmstrain_ekf::live::{Jumps, Repeats, Sieve};
use ohmstrain_ekf::{
    Advanced, Estimator, Guard, Guarded, Innovation, PastStep, Reading, ReadingVerdict, Repeated, StepError, Streak,
    Substeps,
};

/// An estimator under guard, and the steps it has prepared.
pub(crate) struct Stepper<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    pub estimator: Substeps<E>,
    pub guard: Guard<f64>,
    pub sieve: Sieve<f64>,
    /// Of the model's own noise.
    reading_variance: f64,
    prepared: PreparedSteps<Repeated<E::Prepared>>,
    /// Where the next state is made: two take turns.
    next: Option<Box<E::State>>,
}

/// A step as a smoother needs it.
pub(crate) type Taken<E, const N: usize, const L: usize> =
    PastStep<<E as Estimator<f64, N, L>>::State, Repeated<<E as Estimator<f64, N, L>>::Prepared>, f64>;

/// Where a filter is.
#[derive(Clone)]
pub(crate) struct Moment<S> {
    pub time_s: Option<f64>,
    pub state: Box<S>,
    pub streak: Streak,
    repeats: Repeats<f64>,
    jumps: Jumps<f64>,
    pub seen: Seen,
}

/// What a row's reading said.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub innovation: Option<Innovation<f64>>,
    pub verdict: ReadingVerdict,
    /// See [`Output::startled`](crate::Output::startled).
    pub startled: Option<f64>,
}

impl Seen {
    /// A row after other ones; readings that are farther apart than `jump` have jumped, where a guard has weighed them down.
    fn after(
        jumps: &mut Jumps<f64>,
        (innovation, verdict): (Option<Innovation<f64>>, ReadingVerdict),
        reading: Option<Reading<f64>>,
        jump: f64,
    ) -> Self {
        let is_weighed = matches!(verdict, ReadingVerdict::Accepted | ReadingVerdict::Downweighted);
        let nis = innovation.map_or(0.0, |innovation| innovation.nis);
        let taken = reading.filter(|_| is_weighed);
        let jumped = taken.and_then(|reading| jumps.see(reading.value, nis, jump));
        Self { innovation, verdict, startled: jumped.filter(|_| verdict == ReadingVerdict::Downweighted) }
    }
}

impl<S> Moment<S> {
    /// Before the first row.
    pub(crate) fn start(state: S) -> Self {
        let seen = Seen { innovation: None, verdict: ReadingVerdict::Missing, startled: None };
        let (repeats, jumps) = (Repeats::none(), Jumps::none());
        Self { time_s: None, state: Box::new(state), streak: Streak::default(), repeats, jumps, seen }
    }

    fn seconds_until(&self, time_s: f64) -> f64 {
        time_s - self.time_s.unwrap_or(time_s)
    }
}

impl<E: Estimator<f64, N, L>, const N: usize, const L: usize> Stepper<E, N, L> {
    pub(crate) fn new(estimator: E, sieve: Sieve<f64>, reading_variance: f64) -> Self {
        Self {
            estimator: Substeps(estimator),
            guard: Guard::none(),
            sieve,
            reading_variance,
            prepared: PreparedSteps::new(),
            next: None,
        }
    }

    /// A reading as the estimator is to see it, and what became of it where that is decided already. What is no number is the
    /// caller's error, which the estimator tells.
    fn sieved(
        &self,
        repeats: &mut Repeats<f64>,
        dt_s: f64,
        reading: Option<Reading<f64>>,
    ) -> (Option<Reading<f64>>, Option<ReadingVerdict>) {
        repeats.pass(dt_s);
        match reading {
            Some(known) if known.value.is_finite() => match repeats.sieved(&self.sieve, known, self.reading_variance) {
                Ok(known) => (Some(known), None),
                Err(verdict) => (None, Some(verdict)),
            },
            _ => (reading, None),
        }
    }

    /// One step from `now`: where it leads, and what a smoother needs of it.
    pub(crate) fn advance(
        &mut self,
        now: &Moment<E::State>,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<(Moment<E::State>, Taken<E, N, L>), StepError> {
        let (mut repeats, mut jumps, dt_s) = (now.repeats, now.jumps, now.seconds_until(time_s));
        let (reading, decided) = self.sieved(&mut repeats, dt_s, reading);
        let prepared = self.prepared.of(dt_s, |dt_s| self.estimator.prepare(dt_s))?;
        let Guarded { advanced, from, used, verdict, streak } =
            self.guard.advance(&self.estimator, &now.state, now.streak, prepared, reading)?;
        let Advanced { state, innovation } = advanced;
        let said = (innovation, decided.unwrap_or(verdict));
        let seen = Seen::after(&mut jumps, said, reading, self.sieve.jump);
        let next = Moment { time_s: Some(time_s), state: Box::new(state), streak, repeats, jumps, seen };
        Ok((next, PastStep { from, prepared: *prepared, reading: used }))
    }

    /// One step that nobody goes back, so that nothing is kept of it; `now` changes only if it succeeds.
    pub(crate) fn advance_only(
        &mut self,
        now: &mut Moment<E::State>,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<(), StepError> {
        let (came, mut repeats, dt_s) = (reading, now.repeats, now.seconds_until(time_s));
        let (reading, decided) = self.sieved(&mut repeats, dt_s, reading);
        let prepared = self.prepared.of(dt_s, |dt_s| self.estimator.prepare(dt_s))?;
        let next = self.next.get_or_insert_with(|| now.state.clone());
        let (innovation, verdict) = match self.estimator.advance_into(&now.state, prepared, reading, next) {
            Err(error) if reading.is_some() && error.is_of_the_reading() => {
                (self.estimator.advance_into(&now.state, prepared, None, next)?, ReadingVerdict::Rejected)
            }
            taken => {
                let verdict = if reading.is_some() { ReadingVerdict::Accepted } else { ReadingVerdict::Missing };
                (taken?, decided.unwrap_or(verdict))
            }
        };
        if innovation.is_some_and(|innovation| !self.guard.takes_whole(innovation.nis)) {
            (*now, _) = self.advance(now, time_s, came)?;
            return Ok(());
        }
        now.repeats = repeats;
        now.time_s = Some(time_s);
        if reading.is_some() && verdict == ReadingVerdict::Accepted {
            now.streak = Streak::default();
        }
        std::mem::swap(&mut now.state, next);
        now.seen = Seen::after(&mut now.jumps, (innovation, verdict), reading, self.sieve.jump);
        Ok(())
    }
}

/// Prepared steps, remembered by their length in nanoseconds: differences of decimal times repeat to rounding only.
struct PreparedSteps<P> {
    steps: Vec<P>,
    places: HashMap<u64, usize>,
    /// Length and place of the step used last: at a fixed rate it is the next one, too.
    last: Option<(u64, usize)>,
}

/// Recordings repeat a few hundred step lengths; a stream whose steps never repeat must not fill the memory.
const MOST_PREPARED: usize = 4096;

impl<P> PreparedSteps<P> {
    fn new() -> Self {
        Self { steps: Vec::new(), places: HashMap::new(), last: None }
    }

    fn of(&mut self, dt_s: f64, prepare: impl FnOnce(f64) -> P) -> Result<&P, StepError> {
        if !dt_s.is_finite() {
            return Err(StepError::NonFiniteTimeStep);
        }
        if dt_s < 0.0 {
            return Err(StepError::NegativeTimeStep);
        }
        let nanoseconds = (dt_s * 1e9).round();
        let length = nanoseconds as u64;
        let place = match self.last {
            Some((last, place)) if last == length => place,
            _ => self.place_of(length, || prepare(nanoseconds * 1e-9)),
        };
        self.last = Some((length, place));
        Ok(&self.steps[place])
    }

    fn place_of(&mut self, length: u64, prepare: impl FnOnce() -> P) -> usize {
        if let Some(place) = self.places.get(&length) {
            return *place;
        }
        if self.steps.len() >= MOST_PREPARED {
            self.steps.clear();
            self.places.clear();
        }
        self.steps.push(prepare());
        self.places.insert(length, self.steps.len() - 1);
        self.steps.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_PREPARED, PreparedSteps};

    #[test]
    fn a_length_is_prepared_once_until_there_are_too_many() {
        let mut prepared = PreparedSteps::new();
        let mut calls = 0;
        let mut of = |dt_s: f64| {
            let prepare = |dt_s| {
                calls += 1;
                dt_s
            };
            let step: f64 = *prepared.of(dt_s, prepare).unwrap();
            // Lengths are told apart to a nanosecond.
            assert!((step - dt_s).abs() <= 0.5000001e-9, "{step} {dt_s}");
            calls
        };
        assert_eq!([0.1, 0.2, 0.1, 0.1 + 1e-12, 0.2, 0.0].map(&mut of), [1, 2, 2, 2, 2, 3]);
        for k in 0..2 * MOST_PREPARED {
            of(1.0 + k as f64 * 1e-6);
        }
        assert_eq!(of(0.1), 3 + 2 * MOST_PREPARED + 1);
        assert!(prepared.steps.len() <= MOST_PREPARED && prepared.places.len() == prepared.steps.len());
    }
}
