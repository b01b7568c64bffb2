use std::cell::RefCell;
use std::collections::HashMap;

use ohmstrain_ekf::live::SensorEstimator;
use ohmstrain_ekf::{Advanced, Estimator, Gaussian, Innovation, Reading, StepError};

/// An estimator that prepares a step only once for each length, and may take steps longer than its limit. Recordings repeat a
/// few hundred lengths, because differences of decimal times are equal except for rounding.
pub(crate) struct Remembering<E, P> {
    estimator: E,
    /// Factor on the longest step of the estimator.
    step_factor: f64,
    prepared: RefCell<Prepared<P>>,
}

/// Prepared steps.
struct Prepared<P> {
    steps: Vec<P>,
    /// Index of a step by the bits of its length.
    places: HashMap<u64, usize>,
    /// Length and index of the last step used; at a fixed rate the next step is the same.
    last: Option<(u64, usize)>,
}

/// Maximum number of prepared steps, so that a stream whose steps never repeat does not fill the memory.
const MOST_PREPARED: usize = 4096;

impl<E, P: Copy> Remembering<E, P> {
    pub(crate) fn new(estimator: E, step_factor: f64) -> Self {
        Self { estimator, step_factor, prepared: RefCell::new(Prepared::new()) }
    }
}

impl<P: Copy> Prepared<P> {
    fn new() -> Self {
        Self { steps: Vec::new(), places: HashMap::new(), last: None }
    }

    fn of(&mut self, dt_s: f64, prepare: impl FnOnce(f64) -> P) -> P {
        let length = dt_s.to_bits();
        let place = match self.last {
            Some((last, place)) if last == length => place,
            _ => self.place(length, || prepare(dt_s)),
        };
        self.last = Some((length, place));
        self.steps[place]
    }

    fn place(&mut self, length: u64, prepare: impl FnOnce() -> P) -> usize {
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

impl<E, const N: usize, const L: usize> Estimator<f64, N, L> for Remembering<E, E::Prepared>
where
    E: Estimator<f64, N, L>,
{
    type State = E::State;
    type Prepared = E::Prepared;

    fn prepare(&self, dt_s: f64) -> E::Prepared {
        self.prepared.borrow_mut().of(dt_s, |dt_s| self.estimator.prepare(dt_s))
    }

    fn length_s(&self, dt_s: f64) -> f64 {
        (dt_s * 1e9).round() * 1e-9
    }

    fn longest_step_s(&self) -> f64 {
        self.step_factor * self.estimator.longest_step_s()
    }

    fn advance(
        &self,
        state: &E::State,
        prepared: &E::Prepared,
        reading: Option<Reading<f64>>,
    ) -> Result<Advanced<E::State, f64>, StepError> {
        self.estimator.advance(state, prepared, reading)
    }

    fn advance_into(
        &self,
        state: &E::State,
        prepared: &E::Prepared,
        reading: Option<Reading<f64>>,
        next: &mut E::State,
    ) -> Result<Option<Innovation<f64>>, StepError> {
        self.estimator.advance_into(state, prepared, reading, next)
    }

    fn smooth_back(
        &self,
        filtered: &E::State,
        prepared: &E::Prepared,
        reading: Option<Reading<f64>>,
        next: &E::State,
    ) -> Result<E::State, StepError> {
        self.estimator.smooth_back(filtered, prepared, reading, next)
    }
}

impl<E, const N: usize, const L: usize> SensorEstimator<f64, N, L> for Remembering<E, E::Prepared>
where
    E: SensorEstimator<f64, N, L>,
{
    const BRANCHES: usize = E::BRANCHES;

    fn start(&self, strain: Option<Gaussian<f64>>) -> E::State {
        self.estimator.start(strain)
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_PREPARED, Prepared};

    #[test]
    fn a_length_is_prepared_once_until_there_are_too_many() {
        let mut prepared = Prepared::new();
        let mut calls = 0;
        let mut of = |dt_s: f64| {
            let prepare = |dt_s| {
                calls += 1;
                dt_s
            };
            let step: f64 = prepared.of(dt_s, prepare);
            assert_eq!(step, dt_s);
            calls
        };
        assert_eq!([0.1, 0.2, 0.1, 0.1, 0.2, 0.0].map(&mut of), [1, 2, 2, 2, 2, 3]);
        for k in 0..2 * MOST_PREPARED {
            of(1.0 + k as f64 * 1e-6);
        }
        assert_eq!(of(0.1), 3 + 2 * MOST_PREPARED + 1);
        assert!(prepared.steps.len() <= MOST_PREPARED);
    }
}
