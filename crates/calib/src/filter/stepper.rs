use std::collections::HashMap;

use ohmstrain_ekf::live::{Jumps, Repeats, Sieve};
use ohmstrain_ekf::{
    Advanced, Estimator, Guard, Guarded, Innovation, PastStep, Pause, Reading, ReadingVerdict, Repeated, StepError,
    Streak, Substeps,
};

/// An estimator under guard, and the steps it has prepared.
pub(crate) struct Stepper<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    pub estimator: Substeps<E>,
    pub guard: Guard<f64>,
    pub sieve: Sieve<f64>,
    /// Of the model's own noise.
    reading_variance: f64,
    prepared: PreparedSteps<Repeated<E::Prepared, f64>>,
    /// Where the next state is made: two take turns.
    next: Option<Box<E::State>>,
}

/// A step from reading to reading, as a smoother needs it.
pub(crate) type Taken<E, const N: usize, const L: usize> =
    PastStep<<E as Estimator<f64, N, L>>::State, Repeated<<E as Estimator<f64, N, L>>::Prepared, f64>, f64>;

/// A row on the way forward, as a smoother needs it.
pub(crate) enum Row<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    /// The step to a reading that was used.
    Read(Taken<E, N, L>),
    /// The state at a row without one, as the readings before it predict it.
    Unread(Box<E::State>),
}

/// Where a filter is. Only a reading that is used moves it on: a row without one is a look ahead.
#[derive(Clone)]
pub(crate) struct Moment<S> {
    /// Time of the last row, s.
    pub time_s: Option<f64>,
    /// At the last reading that was used, and its time, s; a start that is known counts as one.
    pub state: Box<S>,
    read_s: Option<f64>,
    starts_known: bool,
    /// What has been seen ahead of it since.
    look: Option<Look<S>>,
    pub streak: Streak,
    repeats: Repeats<f64>,
    jumps: Jumps<f64>,
    pub seen: Seen,
}

/// A look ahead from the last reading.
#[derive(Clone)]
struct Look<S> {
    /// Whole steps of the pause later, and the time since then.
    passed: Box<S>,
    pause: Pause<f64>,
    /// At the last row.
    now: Box<S>,
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
    /// Before the first row; `starts_known` if the strain is known then.
    pub(crate) fn start(state: S, starts_known: bool) -> Self {
        let seen = Seen { innovation: None, verdict: ReadingVerdict::Missing, startled: None };
        let (repeats, jumps) = (Repeats::none(), Jumps::none());
        let (state, streak) = (Box::new(state), Streak::default());
        Self { time_s: None, state, starts_known, read_s: None, look: None, streak, repeats, jumps, seen }
    }

    /// The state at the last row.
    pub(crate) fn shown(&self) -> &S {
        self.look.as_ref().map_or(&self.state, |look| &look.now)
    }

    /// A reading was used in a row that leads to a state.
    fn moves_to(&mut self, time_s: f64) {
        (self.read_s, self.look) = (Some(time_s), None);
    }

    fn seconds_until(&self, time_s: f64) -> f64 {
        time_s - self.time_s.unwrap_or(time_s)
    }

    /// A row has come: a start that is known is at the first.
    fn begin(&mut self, time_s: f64) {
        if self.time_s.is_none() && self.starts_known {
            self.read_s = Some(time_s);
        }
    }

    /// Since the last reading that was used; no time before the first.
    fn seconds_since_reading(&self, time_s: f64) -> f64 {
        time_s - self.read_s.unwrap_or(time_s)
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

    /// One row from `now`: where it leads, and what a smoother needs of it.
    pub(crate) fn advance(
        &mut self,
        now: &Moment<E::State>,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<(Moment<E::State>, Row<E, N, L>), StepError> {
        let mut next = now.clone();
        let taken = self.take(&mut next, time_s, reading)?;
        let row = match taken {
            Some((from, prepared, used)) => Row::Read(PastStep { from, prepared, reading: used }),
            None => Row::Unread(Box::new(next.shown().clone())),
        };
        Ok((next, row))
    }

    /// One row under guard; what led to its reading, if that was used. `now` changes only if it succeeds.
    #[allow(clippy::type_complexity, reason = "a past step, in parts")]
    fn take(
        &mut self,
        now: &mut Moment<E::State>,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<Option<(E::State, Repeated<E::Prepared, f64>, Option<Reading<f64>>)>, StepError> {
        let (mut repeats, dt_s) = (now.repeats, now.seconds_until(time_s));
        check(dt_s)?;
        now.begin(time_s);
        let (reading, decided) = self.sieved(&mut repeats, dt_s, reading);
        let taken = if let Some(reading) = reading {
            let prepared = self.prepared.of(now.seconds_since_reading(time_s), |dt_s| self.estimator.prepare(dt_s))?;
            let guarded = self.guard.advance(&self.estimator, &now.state, now.streak, prepared, Some(reading))?;
            Some((guarded, *prepared, reading))
        } else {
            None
        };
        match taken {
            Some((guarded, prepared, reading)) if guarded.verdict.is_taken() => {
                let Guarded { advanced: Advanced { state, innovation }, from, used, verdict, streak } = guarded;
                now.seen = Seen::after(&mut now.jumps, (innovation, verdict), Some(reading), self.sieve.jump);
                *now.state = state;
                now.moves_to(time_s);
                (now.time_s, now.repeats, now.streak) = (Some(time_s), repeats, streak);
                Ok(Some((from, prepared, used)))
            }
            refused => {
                self.look(now, time_s)?;
                let said = refused.map(|(guarded, ..)| (guarded.advanced.innovation, guarded.verdict, guarded.streak));
                let (innovation, verdict, streak) =
                    said.unwrap_or((None, decided.unwrap_or(ReadingVerdict::Missing), now.streak));
                now.seen = Seen { innovation, verdict, startled: None };
                (now.time_s, now.repeats, now.streak) = (Some(time_s), repeats, streak);
                Ok(None)
            }
        }
    }

    /// Looks ahead from the last reading to `time_s`.
    fn look(&self, now: &mut Moment<E::State>, time_s: f64) -> Result<(), StepError> {
        let (mut passed, pause, since_s) = match &now.look {
            Some(look) => (look.passed.clone(), look.pause, now.time_s),
            None => (now.state.clone(), self.estimator.pause(), now.read_s),
        };
        let since_s = now.read_s.and(since_s).unwrap_or(time_s);
        let mut pause = pause.after(time_s - since_s);
        self.estimator.pass_whole(&mut passed, &mut pause)?;
        let prepared = self.estimator.prepare_over(pause);
        let ahead = self.estimator.advance(&passed, &prepared, None)?.state;
        now.look = Some(Look { passed, pause, now: Box::new(ahead) });
        Ok(())
    }

    /// One row that nobody goes back to, so that nothing is kept of it; `now` changes only if it succeeds.
    pub(crate) fn advance_only(
        &mut self,
        now: &mut Moment<E::State>,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<(), StepError> {
        let (mut repeats, dt_s) = (now.repeats, now.seconds_until(time_s));
        check(dt_s)?;
        now.begin(time_s);
        let (Some(sieved), _) = self.sieved(&mut repeats, dt_s, reading) else {
            return self.take(now, time_s, reading).map(drop);
        };
        let prepared = self.prepared.of(now.seconds_since_reading(time_s), |dt_s| self.estimator.prepare(dt_s))?;
        let next = self.next.get_or_insert_with(|| now.state.clone());
        match self.estimator.advance_into(&now.state, prepared, Some(sieved), next) {
            Err(error) if error.is_of_the_reading() => return self.take(now, time_s, reading).map(drop),
            Ok(Some(innovation)) if self.guard.takes_whole(innovation.nis) => {
                let said = (Some(innovation), ReadingVerdict::Accepted);
                now.seen = Seen::after(&mut now.jumps, said, Some(sieved), self.sieve.jump);
            }
            Ok(_) => return self.take(now, time_s, reading).map(drop),
            Err(error) => return Err(error),
        }
        (now.repeats, now.time_s, now.streak) = (repeats, Some(time_s), Streak::default());
        std::mem::swap(&mut now.state, next);
        now.moves_to(time_s);
        Ok(())
    }
}

fn check(dt_s: f64) -> Result<(), StepError> {
    if !dt_s.is_finite() {
        return Err(StepError::NonFiniteTimeStep);
    }
    if dt_s < 0.0 { Err(StepError::NegativeTimeStep) } else { Ok(()) }
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
        check(dt_s)?;
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
