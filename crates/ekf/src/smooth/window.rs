use ohmstrain_model::Scalar;

use crate::ekf::check_time_step;
use crate::{Estimator, PastStep, Reading, StepError, smooth_back_through};

/// The last `D` steps in fixed memory: for estimates with a fixed lag, and for readings that arrive late.
///
/// The cost of a lagged estimate is `D` smoothing steps however long the filter has run.
///
/// ```
/// # use ohmstrain_ekf::*;
/// # use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
/// #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01, branches: [],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 0.0, baseline_sd: 0.0, baseline_time_s: 1.0 };
/// # let model = SwitchedModel::<f64, 0, 2>::new(law, motion, noise)?;
/// let ekf = Ekf::new(model);
/// let start: Belief<f64, 2, 3> = Belief::initial(&model);
/// let mut window: Window<_, _, _, 8> = Window::new(start);
/// for rho in [0.01, 0.03, 0.06, 0.08] {
///     window.step(&ekf, 0.05, Some(rho.into()))?;
/// }
/// // The state two steps ago, from all readings since.
/// let lagged = window.lagged(&ekf, 2)?;
/// // A reading taken 70 ms before the newest one arrives only now.
/// window.insert_late(&ekf, 0.07, 0.025.into())?;
/// # assert!(lagged.is_some() && window.newest().is_finite());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window<S, P, T, const D: usize> {
    newest: S,
    steps: [Option<TimedStep<S, P, T>>; D],
    /// Place of the next step, one past the newest.
    next: usize,
    len: usize,
}

/// A step and its length, s.
type TimedStep<S, P, T> = (T, PastStep<S, P, T>);

impl<S: Clone, P: Copy, T: Scalar, const D: usize> Window<S, P, T, D> {
    const CAPACITY: () = assert!(D >= 1, "a window holds at least one step");

    /// An empty window before the first step.
    pub fn new(start: S) -> Self {
        let () = Self::CAPACITY;
        Self { newest: start, steps: core::array::from_fn(|_| None), next: 0, len: 0 }
    }

    /// The state after the newest step.
    pub const fn newest(&self) -> &S {
        &self.newest
    }

    /// Takes a step of `dt_s ≥ 0` seconds and remembers it.
    ///
    /// # Errors
    /// See [`StepError`]; the window stays as it was.
    pub fn step<E, const N: usize, const L: usize>(
        &mut self,
        estimator: &E,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<(), StepError>
    where
        E: Estimator<T, N, L, State = S, Prepared = P>,
    {
        check_time_step(dt_s)?;
        let prepared = estimator.prepare(dt_s);
        let advanced = estimator.advance(&self.newest, &prepared, reading)?;
        let from = core::mem::replace(&mut self.newest, advanced.state);
        self.push((dt_s, PastStep { from, prepared, reading }));
        Ok(())
    }

    /// The state `steps_back` steps ago given all readings up to now; `None` if the window does not reach back so far or
    /// the estimator has no smoother.
    ///
    /// # Errors
    /// See [`StepError`].
    pub fn lagged<E, const N: usize, const L: usize>(
        &self,
        estimator: &E,
        steps_back: usize,
    ) -> Result<Option<S>, StepError>
    where
        E: Estimator<T, N, L, State = S, Prepared = P>,
    {
        if steps_back > self.len {
            return Ok(None);
        }
        let mut lagged = self.newest.clone();
        let past = self.newest_first().take(steps_back).map(|(_, step)| step);
        let has_smoother = smooth_back_through(estimator, &self.newest, past, |state| {
            lagged = state.clone();
            true
        })?;
        Ok((has_smoother || steps_back == 0).then_some(lagged))
    }

    /// Takes in a reading that was taken `age_s ≥ 0` seconds before the newest one: goes back to the step in which it
    /// belongs and takes every step since then again.
    ///
    /// # Errors
    /// [`StepError::ReadingTooOld`] if the window does not reach back so far; the window stays as it was.
    pub fn insert_late<E, const N: usize, const L: usize>(
        &mut self,
        estimator: &E,
        age_s: T,
        reading: Reading<T>,
    ) -> Result<(), StepError>
    where
        E: Estimator<T, N, L, State = S, Prepared = P>,
    {
        check_time_step(age_s)?;
        let mut end_age_s = T::zero();
        let mut back = 0;
        for (dt_s, _) in self.newest_first() {
            if age_s <= end_age_s + *dt_s {
                break;
            }
            end_age_s += *dt_s;
            back += 1;
        }
        let Some((dt_s, belongs_in)) = self.newest_first().nth(back) else { return Err(StepError::ReadingTooOld) };
        let mut replayed = self.clone();
        replayed.next = (self.next + D - 1 - back) % D;
        replayed.len = self.len - 1 - back;
        replayed.newest = belongs_in.from.clone();
        let after_s = age_s - end_age_s;
        replayed.step(estimator, (*dt_s - after_s).max(T::zero()), Some(reading))?;
        replayed.step(estimator, after_s, belongs_in.reading)?;
        for (dt_s, step) in (0..back).rev().filter_map(|k| self.newest_first().nth(k)) {
            replayed.step(estimator, *dt_s, step.reading)?;
        }
        *self = replayed;
        Ok(())
    }

    /// Goes on from another state, one that was re-zeroed for instance. Earlier steps are forgotten: taking them again
    /// for a late reading would undo the change.
    pub fn restart(&mut self, state: S) {
        *self = Self::new(state);
    }

    fn push(&mut self, step: TimedStep<S, P, T>) {
        if let Some(place) = self.steps.get_mut(self.next) {
            *place = Some(step);
            self.next = (self.next + 1) % D;
            self.len = (self.len + 1).min(D);
        }
    }

    fn newest_first(&self) -> impl Iterator<Item = &TimedStep<S, P, T>> {
        (1..=self.len).filter_map(move |back| self.steps.get((self.next + D - back) % D)?.as_ref())
    }
}
