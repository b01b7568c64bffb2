//! A sensor's filter at a fixed rate, in single and in double precision.

use ohmstrain_ekf::live::{LiveParts, may_be_unstretched};
use ohmstrain_ekf::{
    Compact, Ekf, Estimator, Evidence, Hypotheses, LONGEST_PAUSE_S, Pause, STEP_GRACE, STEP_GROWTH, SignSplit,
    SparseEkf, StepError,
};
use ohmstrain_model::{Motion, SensorLaw, StrainRange, SwitchedModel};
use ohmstrain_sensor::{EstimatorKind, EstimatorParams, HISTORIES, HYPOTHESES, PhaseParams, SensorParams};

use super::law::{PriorConstants, narrow_noise};
use super::plan::ChipFilter;
use super::steps::StepTable;
use super::twin::parts::{Numbers, Parts, filter_parts};
use super::{ExportError, parameter};

/// A filter in single precision, with the parts that depend on the number of states.
pub struct FixedRate<'a, const B: usize, const N: usize> {
    /// The model in double precision, for simulation and to measure rounding errors.
    pub reference: SwitchedModel<f64, B, N>,
    /// The model in single precision.
    pub model: SwitchedModel<f32, B, N>,
    /// Number of hypotheses that it keeps; 1 for a single Gaussian.
    pub hypotheses: usize,
    /// All other parts.
    pub parts: Parts<'a>,
    /// Constants that depend on the length of a step.
    pub table: StepTable,
}

impl<'a, const B: usize, const N: usize> FixedRate<'a, B, N> {
    /// Prepares a sensor's filter for readings every `dt_s` seconds.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn new<const L: usize>(params: &SensorParams, filter: &'a ChipFilter, dt_s: f32) -> Result<Self, ExportError> {
        let longest_s = params.validity.duration_s;
        if dt_s * 1e6 < 1.0 || f64::from(dt_s) > longest_s {
            return Err(ExportError::Interval(format!(
                "expected between a microsecond and the longest recording, {longest_s} s, found {dt_s}"
            )));
        }
        let ChipFilter { filter, quadratics } = filter;
        let EstimatorParams { noise, motion, phases, .. } = filter.estimator;
        let speed = phases.map_or(0.0, |phases| phases.speed_per_s);
        let law: SensorLaw<f64, B> = params
            .law
            .to_model()
            .ok_or_else(|| ExportError::Parameter("field `law.branches`: another number of them".into()))?;
        let reference = motion
            .to_model()
            .and_then(|motion| motion.with_phase_rate(speed))
            .and_then(|motion| SwitchedModel::new(law, motion, noise.to_model()))
            .map_err(parameter)?;
        let [time, rate_sd, mean, sd] = PriorConstants::new(&motion).numbers();
        let model = Motion::ornstein_uhlenbeck(time, rate_sd, mean, sd)
            .and_then(|motion| motion.with_phase_rate(speed as f32))
            .and_then(|motion| SwitchedModel::new(law.to(), motion, narrow_noise(noise.to_model())))
            .map_err(parameter)?;
        let phases = phases.filter(|_| filter.kind != EstimatorKind::Ekf);
        let live = LiveParts { dt_s: f64::from(dt_s), ..filter.parts };
        let (correction, quadratics) = (filter.correction.as_ref(), quadratics.as_ref());
        let mut parts = Parts { kind: filter.kind, phases, live, curve: filter.curve, correction, quadratics };
        let longest_s = longest_step_s::<B, N, L>(&reference, &parts)? * STEP_GRACE;
        let usual_s = f64::from(dt_s) / (f64::from(dt_s) / longest_s).ceil().max(1.0);
        let kernel = |step_s| SparseEkf::<f64, Compact, B, N>::new(reference, step_s).map_err(parameter);
        let numbers = |step_s| exact_numbers(&reference, phases, step_s).map_err(parameter);
        let table = StepTable::new(usual_s, &kernel(usual_s)?.step_names(), numbers)?;
        // Not longer than the table allows.
        parts.live.longest_step_s = f64::from((longest_s.min(table.range.1) / STEP_GRACE) as f32);
        Ok(Self { reference, model, hypotheses: filter.hypotheses, parts, table })
    }

    /// Converts its surroundings to single precision.
    pub fn narrow(&self) -> LiveParts<f32, ()> {
        self.parts.live.to()
    }

    /// Returns R₀ if the rested sensor reads `measured` today.
    pub fn rest_reading_at(&self, measured: f32) -> f32 {
        let LiveParts { rest_reading, rested, .. } = self.narrow();
        rest_reading * (measured / rested)
    }

    /// True if a rested sensor can have zero strain.
    pub fn rests_at_zero(&self) -> bool {
        may_be_unstretched(&self.narrow().limits)
    }

    /// Returns the length of the last step into which the usual time between readings is divided, s.
    pub fn usual_step_s(&self) -> f32 {
        let LiveParts { longest_step_s, dt_s, .. } = self.narrow();
        let mut pause = Pause::none(longest_step_s).after(dt_s);
        while pause.whole_step().is_some() {}
        pause.last_steps().1
    }

    /// Returns the lengths of the whole steps of a pause, s.
    pub fn whole_steps_s(&self) -> Vec<f32> {
        let growth = STEP_GROWTH as f32;
        let lengths = std::iter::successors(Some(self.narrow().longest_step_s), |length_s| Some(length_s * growth));
        lengths.take_while(|length_s| f64::from(*length_s) < LONGEST_PAUSE_S).collect()
    }

    /// Returns the constants that depend on the length of a step, as the exported program interpolates them.
    pub fn interpolated(&self) -> Numbers<'_, f32> {
        let known: Vec<(f32, Vec<f32>)> = [self.usual_step_s(), 0.0]
            .into_iter()
            .chain(self.whole_steps_s())
            .map(|step_s| (step_s, self.numbers_at(step_s)))
            .collect();
        let of = move |step_s| {
            let known = known.iter().find(|(length_s, _)| *length_s == step_s);
            known.map_or_else(|| self.table.at(step_s), |(_, numbers)| numbers.clone())
        };
        Numbers { of: Box::new(of), length_s: |dt_s| dt_s }
    }

    /// Returns the numbers in double precision, computed by the law, for lengths rounded to a nanosecond, as in the library.
    pub fn exact(&self) -> Numbers<'_, f64> {
        let of = |step_s| {
            let numbers = exact_numbers(&self.reference, self.parts.phases, step_s);
            numbers.unwrap_or_else(|_| self.table.at(step_s))
        };
        Numbers { of: Box::new(of), length_s: |dt_s| (dt_s * 1e9).round() * 1e-9 }
    }

    /// Computes the constants for a step of `step_s` seconds, rounded.
    pub fn numbers_at(&self, step_s: f32) -> Vec<f32> {
        let numbers = exact_numbers(&self.reference, self.parts.phases, step_s.into());
        numbers.map_or_else(|_| self.table.at(step_s), |all| all.iter().map(|x| *x as f32).collect())
    }
}

/// Computes the numbers of the kernel, and of the chain, for steps of a length.
fn exact_numbers<const B: usize, const N: usize>(
    model: &SwitchedModel<f64, B, N>,
    phases: Option<PhaseParams>,
    step_s: f64,
) -> Result<Vec<f64>, StepError> {
    let kernel = SparseEkf::<f64, Compact, B, N>::at_a_moment(*model)?;
    let kernel = if step_s > 0.0 { SparseEkf::new(*model, step_s)? } else { kernel };
    let mut numbers = kernel.step_numbers();
    let limits = StrainRange { lower: 0.0, upper: 1.0 };
    let chain = match phases {
        Some(phases) => filter_parts::<f64>(&phases, limits)?.0.probabilities(step_s),
        None => [[0.0; 3]; 3],
    };
    numbers.extend(chain.as_flattened());
    Ok(numbers)
}

/// Returns the longest step over which a prediction is as good as many short ones, s.
pub(super) fn longest_step_s<const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<f64, B, N>,
    parts: &Parts<'_>,
) -> Result<f64, ExportError> {
    let longest_s = match parts.phases {
        None => longest::<N, L>(&Ekf::new(*model)),
        Some(phases) => {
            let (dwell, evidence): (_, Evidence<f64>) = filter_parts(&phases, parts.limits_in()).map_err(parameter)?;
            let hold = phases.rests().then_some(dwell);
            if parts.kind == EstimatorKind::SignSplit {
                let filter = SignSplit::<_, B, N, HYPOTHESES>::new(*model, 0.0, hold, evidence);
                longest::<N, L>(&filter.map_err(parameter)?)
            } else {
                let filter = Hypotheses::<_, B, N, HISTORIES>::new(*model, 0.0, dwell, evidence);
                longest::<N, L>(&filter.map_err(parameter)?)
            }
        }
    };
    Ok(longest_s)
}

fn longest<const N: usize, const L: usize>(estimator: &impl Estimator<f64, N, L>) -> f64 {
    estimator.longest_step_s()
}
