use std::collections::HashMap;

use ohmstrain_ekf::{Belief, Dynamics, Ekf, Estimate, Gaussian, Reading, Step, StepError, rts_smooth_vec};
use ohmstrain_model::{Motion, Phase, StrainRange, SwitchedModel, SwitchedStep};

use crate::CalibrationError;
use crate::params::{AnyMotion, EstimatorKind, EstimatorParams, LawParams, RangeParams, SensorParams};

/// A filter for a sensor whose number of branches and kind of motion are known at run time only.
pub trait Filter {
    /// Takes the reading `R/R₀ - 1` at `time_s`; `None` if it is missing. The first call is an update without a
    /// prediction.
    ///
    /// # Errors
    /// See [`StepError`]. The filter stays as it was: the next good row goes on from the last good one.
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError>;

    /// Strain within the limits.
    fn strain(&self) -> Gaussian<f64>;

    /// Everything that is reported.
    fn output(&self) -> Output;

    /// Smooths a whole recording, from the state the filter is in.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn smooth(
        &mut self,
        time_s: &[f64],
        readings: &[Option<Reading<f64>>],
    ) -> Result<Option<Vec<Output>>, (usize, StepError)>;
}

/// What a filter or smoother says at one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// The estimate.
    pub estimate: Estimate<f64>,
    /// Normalised innovation squared of the row's reading; `None` if it was missing.
    pub nis: Option<f64>,
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// The long-run distribution of the calibration.
    Unknown,
    /// A strain that is known to the limits' resolution, at rest.
    Strain(f64),
}

/// Share of the limits' span to which a given initial strain is believed.
const START_SD: f64 = 1e-3;

/// Builds the filter for a sensor.
///
/// # Errors
/// If the sensor has no parameters for the estimator, or more branches than four.
pub fn build_filter(
    params: &SensorParams,
    kind: Option<EstimatorKind>,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    let estimator = params.estimator(kind)?;
    filter_from_parts(&params.law, estimator, params.limits, start)
}

pub(crate) fn filter_from_parts(
    law: &LawParams,
    estimator: &EstimatorParams,
    limits: RangeParams,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    /// One instance per number of motion states and branches; N = M + B + 1, L = N (N + 1) / 2.
    macro_rules! build {
        ($motion:expr, $m:literal, $([$b:literal, $n:literal, $l:literal]),+) => {
            match law.branches.len() {
                $($b => Ok(Box::new(EkfFilter::<$m, $b, $n, $l>::new($motion, law, estimator, limits, start)?)
                    as Box<dyn Filter>),)+
                many => Err(CalibrationError::Unsupported(format!("a law with {many} branches; at most 4 are supported"))),
            }
        };
    }
    match estimator.motion.to_model()? {
        AnyMotion::Two(motion) => build!(motion, 2, [0, 3, 6], [1, 4, 10], [2, 5, 15], [3, 6, 21], [4, 7, 28]),
        AnyMotion::Three(motion) => build!(motion, 3, [0, 4, 10], [1, 5, 15], [2, 6, 21], [3, 7, 28], [4, 8, 36]),
    }
}

struct EkfFilter<const M: usize, const B: usize, const N: usize, const L: usize> {
    ekf: Ekf<SwitchedModel<f64, M, B, N>>,
    limits: StrainRange<f64>,
    belief: Belief<f64, N, L>,
    last_time_s: Option<f64>,
    nis: Option<f64>,
    prepared: HashMap<u64, SwitchedStep<f64, M, B>>,
}

/// Recordings repeat a few hundred step lengths; a stream whose steps never repeat must not fill the memory.
const MOST_PREPARED: usize = 4096;

impl<const M: usize, const B: usize, const N: usize, const L: usize> EkfFilter<M, B, N, L> {
    fn new(
        motion: Motion<f64, M>,
        law: &LawParams,
        estimator: &EstimatorParams,
        limits: RangeParams,
        start: Start,
    ) -> Result<Self, CalibrationError> {
        let law = law.to_model().ok_or_else(|| CalibrationError::Unsupported("number of branches".into()))?;
        let model = SwitchedModel::new(law, motion, estimator.noise.to_model())?;
        let mut belief = Belief::initial(&model);
        if let Start::Strain(strain) = start {
            let (_, mut variance) = model.initial_distribution();
            variance[0] = (START_SD * limits.span()).powi(2);
            belief = Belief::independent(belief.mean, &variance);
            belief.mean[0] = strain;
        }
        Ok(Self {
            ekf: Ekf::new(model),
            limits: limits.to_model(),
            belief,
            last_time_s: None,
            nis: None,
            prepared: HashMap::new(),
        })
    }

    /// One step; the filter changes only if it succeeds.
    fn advance(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<Step<f64, N, L>, StepError> {
        let dt_s = time_s - self.last_time_s.unwrap_or(time_s);
        let step = if dt_s > 0.0 && dt_s.is_finite() {
            let prepared = self.prepare(dt_s);
            self.ekf.step_prepared(&self.belief, &prepared, reading)?
        } else {
            self.ekf.step(&self.belief, dt_s, reading)?
        };
        self.belief = step.posterior;
        self.last_time_s = Some(time_s);
        self.nis = step.update.map(|update| update.nis);
        Ok(step)
    }

    /// The prepared step, remembered by its length in nanoseconds: differences of decimal times repeat to rounding only.
    fn prepare(&mut self, dt_s: f64) -> SwitchedStep<f64, M, B> {
        let nanoseconds = (dt_s * 1e9).round().max(1.0);
        if self.prepared.len() >= MOST_PREPARED {
            self.prepared.clear();
        }
        let model = self.ekf.model();
        *self
            .prepared
            .entry(nanoseconds as u64)
            .or_insert_with(|| Dynamics::<f64, N, L>::prepare(model, nanoseconds * 1e-9))
    }

    fn output_of(&self, belief: &Belief<f64, N, L>, nis: Option<f64>) -> Output {
        Output { estimate: Estimate::new(self.ekf.model(), belief, &self.limits), nis }
    }
}

impl<const M: usize, const B: usize, const N: usize, const L: usize> Filter for EkfFilter<M, B, N, L> {
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.advance(time_s, reading).map(|_| ())
    }

    fn strain(&self) -> Gaussian<f64> {
        Gaussian { mean: self.belief.mean[0], variance: self.belief.covariance[(0, 0)] }.clamped(&self.limits)
    }

    fn output(&self) -> Output {
        self.output_of(&self.belief, self.nis)
    }

    fn smooth(&mut self, time_s: &[f64], readings: &[Option<Reading<f64>>]) -> Result<Vec<Output>, (usize, StepError)> {
        let mut steps = Vec::with_capacity(time_s.len());
        for (row, (&time_s, &reading)) in time_s.iter().zip(readings).enumerate() {
            steps.push(self.advance(time_s, reading).map_err(|error| (row, error))?);
        }
        let smoothed = rts_smooth_vec(&steps);
        let nis = |step: &Step<f64, N, L>| step.update.map(|update| update.nis);
        Ok(smoothed.iter().zip(&steps).map(|(belief, step)| self.output_of(belief, nis(step))).collect())
    }
}
