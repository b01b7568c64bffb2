//! The exported program in Rust, in any precision: the library's live filter, whose steps are computed from the same numbers as
//! in the C program.

mod learned;
pub mod parts;

use std::cell::Cell;

use ohmstrain_ekf::live::{Learned, LiveFilter, SensorEstimator};
use ohmstrain_ekf::{
    Advanced, Compact, Estimator, Gaussian, Hypotheses, Reading, Real, SignSplit, SparseEkf, State, StepError,
};
use ohmstrain_model::SwitchedModel;
use ohmstrain_sensor::{EstimatorKind, HISTORIES, HYPOTHESES};

use super::ExportError;
use super::fixed_rate::FixedRate;
pub use learned::OwnedLearned;
pub use parts::{Numbers, Parts, bits, filter_parts};

/// Number of probabilities of the chain.
const CHAIN: usize = 9;

/// A filter whose steps are computed from given numbers.
pub trait StepNumbers<T>: Copy {
    /// Sets the length of steps to `step_s`, with its numbers.
    fn set_numbers(&mut self, step_s: T, numbers: &[T], chain: [[T; 3]; 3]);
}

impl<T: Real, const B: usize, const N: usize> StepNumbers<T> for SparseEkf<T, Compact, B, N> {
    fn set_numbers(&mut self, step_s: T, numbers: &[T], _: [[T; 3]; 3]) {
        self.set_step(step_s, numbers);
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize> StepNumbers<T> for SignSplit<T, B, N, K, Compact> {
    fn set_numbers(&mut self, step_s: T, numbers: &[T], chain: [[T; 3]; 3]) {
        self.set_step(step_s, numbers, chain);
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize> StepNumbers<T> for Hypotheses<T, B, N, K, Compact> {
    fn set_numbers(&mut self, step_s: T, numbers: &[T], chain: [[T; 3]; 3]) {
        self.set_step(step_s, numbers, chain);
    }
}

/// A filter as it is exported.
pub struct Twin<'a, T, F> {
    filter: F,
    /// Largest number of hypotheses that it keeps.
    hypotheses: usize,
    numbers: Numbers<'a, T>,
    /// Numbers of hypotheses that have been propagated, with a reading and without.
    work: [Cell<usize>; 2],
}

impl<T, F> Twin<'_, T, F> {
    /// Returns the numbers of hypotheses that have been propagated, with a reading and without: they determine a filter's instructions.
    pub fn work(&self) -> [usize; 2] {
        self.work.each_ref().map(Cell::get)
    }
}

impl<T, F, const N: usize, const L: usize> Estimator<T, N, L> for Twin<'_, T, F>
where
    T: Real,
    F: Estimator<T, N, L, Prepared = F> + StepNumbers<T>,
{
    type State = F::State;
    type Prepared = F;

    fn prepare(&self, dt_s: T) -> F {
        let (all, mut filter) = ((self.numbers.of)(dt_s), self.filter);
        let (numbers, chain) = all.split_at(all.len() - CHAIN);
        filter.set_numbers(dt_s, numbers, [0, 1, 2].map(|from| [0, 1, 2].map(|to| chain[3 * from + to])));
        filter
    }

    fn length_s(&self, dt_s: T) -> T {
        (self.numbers.length_s)(dt_s)
    }

    fn longest_step_s(&self) -> T {
        self.filter.longest_step_s()
    }

    fn advance(
        &self,
        state: &F::State,
        prepared: &F,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<F::State, T>, StepError> {
        let work = &self.work[usize::from(reading.is_none())];
        state.each(&mut |_, _| work.set(work.get() + 1));
        self.filter.advance(state, prepared, reading)
    }
}

impl<T, F, const N: usize, const L: usize> SensorEstimator<T, N, L> for Twin<'_, T, F>
where
    T: Real,
    F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>,
{
    const BRANCHES: usize = F::BRANCHES;

    fn start(&self, strain: Option<Gaussian<T>>) -> F::State {
        self.filter.start(strain).keeping(self.hypotheses)
    }
}

/// A twin with everything around it.
pub type TwinFilter<'a, T, F, const N: usize, const L: usize> = LiveFilter<T, Twin<'a, T, F>, Learned<'a, T>, N, L>;

/// A task for a sensor's twin.
pub trait Task<T: Real> {
    /// Its result.
    type Output;

    /// Runs the task.
    ///
    /// # Errors
    /// If the filter refuses a step.
    fn run<F, const N: usize, const L: usize>(
        self,
        live: TwinFilter<'_, T, F, N, L>,
    ) -> Result<Self::Output, StepError>
    where
        F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>;
}

/// Runs a task with the twin of a sensor, in the precision of a model.
///
/// # Errors
/// If the filter refuses its numbers, or a step.
pub fn with_twin<T: Real, const B: usize, const N: usize, const L: usize, J: Task<T>>(
    sensor: &FixedRate<'_, B, N>,
    model: SwitchedModel<T, B, N>,
    numbers: Numbers<'_, T>,
    task: J,
) -> Result<J::Output, ExportError> {
    let parts = &sensor.parts;
    let kernel = SparseEkf::<T, Compact, B, N>::new(model, T::of(parts.live.dt_s)).map_err(refused)?;
    let of = Of { sensor, numbers, task };
    let output = match (parts.kind, parts.phases) {
        (EstimatorKind::SignSplit, Some(phases)) => {
            let (dwell, evidence) = filter_parts(&phases, parts.limits_in()).map_err(refused)?;
            let hold = phases.rests().then_some(dwell);
            of.run::<_, N, L>(SignSplit::<T, B, N, HYPOTHESES, Compact>::around(kernel, hold, evidence))
        }
        (EstimatorKind::Hypotheses, Some(phases)) => {
            let (dwell, evidence) = filter_parts(&phases, parts.limits_in()).map_err(refused)?;
            of.run::<_, N, L>(Hypotheses::<T, B, N, HISTORIES, Compact>::around(kernel, dwell, evidence))
        }
        _ => of.run::<_, N, L>(kernel),
    };
    output.map_err(refused)
}

/// A task, and the sensor for it.
struct Of<'a, 'b, T, J, const B: usize, const S: usize> {
    sensor: &'a FixedRate<'b, B, S>,
    numbers: Numbers<'a, T>,
    task: J,
}

impl<T: Real, J: Task<T>, const B: usize, const S: usize> Of<'_, '_, T, J, B, S> {
    fn run<F, const N: usize, const L: usize>(self, filter: F) -> Result<J::Output, StepError>
    where
        F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>,
    {
        let Self { sensor, numbers, task } = self;
        let parts = &sensor.parts;
        let learned =
            parts.correction.map(|correction| OwnedLearned::new(correction, parts.quadratics, parts.limits_in()));
        let twin = Twin { filter, hypotheses: sensor.hypotheses, numbers, work: [const { Cell::new(0) }; 2] };
        let curve = parts.curve.map(|curve| curve.to());
        let parts = parts.live.to().with_correction(learned.as_ref().map(OwnedLearned::learned));
        task.run(LiveFilter::new(twin, parts).on_curve(curve))
    }
}

/// Converts the refusal of a step of the filter's own vectors to an error.
pub fn refused(error: StepError) -> ExportError {
    ExportError::Parameter(format!("the filter refuses the law's own readings: {error}"))
}
