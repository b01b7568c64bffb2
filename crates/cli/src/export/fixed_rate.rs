//! A sensor's filter at a fixed rate, in single and in double precision.

use ohmstrain_calib::{EstimatorKind, EstimatorParams, HISTORIES, HYPOTHESES, SensorParams};
use ohmstrain_ekf::correction::FeatureScale;
use ohmstrain_ekf::live::{DOUBT, Learned, LiveParts, may_be_unstretched};
use ohmstrain_ekf::{
    Compact, Ekf, Estimator, Evidence, Hypotheses, LONGEST_PAUSE_S, Pause, Real, STEP_GRACE, STEP_GROWTH, SignSplit,
    SparseEkf, StepError,
};
use ohmstrain_model::{Motion, SensorLaw, StrainRange, SwitchedModel};

use super::law::{PriorConstants, narrow_law, narrow_noise, narrow_range};
use super::plan::ChipFilter;
use super::steps::StepTable;
use super::twin::{Numbers, Parts, PhaseParts, number};
use super::{ExportError, parameter};

/// A filter in single precision, with what the numbers of states in its type are made for.
pub struct FixedRate<'a, const B: usize, const N: usize> {
    /// The model in double precision, for simulation and to see what rounding does.
    pub reference: SwitchedModel<f64, B, N>,
    /// The model in single precision.
    pub model: SwitchedModel<f32, B, N>,
    /// How many hypotheses it keeps; 1 if it keeps none.
    pub hypotheses: usize,
    /// R₀ of the law, and what the rested sensor read in calibration.
    pub rest_reading: f32,
    pub rested: f32,
    /// Everything else.
    pub parts: Parts<'a>,
    /// What depends on the length of a step.
    pub table: StepTable,
}

impl<'a, const B: usize, const N: usize> FixedRate<'a, B, N> {
    /// Of a sensor, at `dt_s` seconds from reading to reading.
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
        let EstimatorParams { noise, motion, phases, strain_sd_scale, .. } = filter.estimator;
        let [time, rate_sd, mean, sd] = PriorConstants::new(&motion).numbers();
        let speed = phases.map_or(0.0, |phases| phases.speed_per_s);
        let law: SensorLaw<f64, B> = params
            .law
            .to_model()
            .ok_or_else(|| ExportError::Parameter("field `law.branches`: another number of them".into()))?;
        let reference = Motion::ornstein_uhlenbeck(time, rate_sd, mean, sd)
            .and_then(|motion| motion.with_phase_rate(number(speed)))
            .and_then(|motion| SwitchedModel::new(law, motion, noise.to_model()))
            .map_err(parameter)?;
        let [time, rate_sd, mean, sd] = [time, rate_sd, mean, sd].map(|x| x as f32);
        let model = Motion::ornstein_uhlenbeck(time, rate_sd, mean, sd)
            .and_then(|motion| motion.with_phase_rate(speed as f32))
            .and_then(|motion| SwitchedModel::new(narrow_law(&law), motion, narrow_noise(noise.to_model())))
            .map_err(parameter)?;
        let limits = narrow_range(params.limits.to_model());
        let phases = phases.map(|phases| PhaseParts {
            hold_time_s: phases.hold_time_s,
            move_time_s: phases.move_time_s,
            reversal: phases.reversal,
            tempering: phases.tempering,
            rests: phases.rests(),
        });
        let phases = phases.filter(|_| filter.kind != EstimatorKind::Ekf);
        let mut parts = Parts {
            kind: filter.kind,
            dt_s,
            longest_step_s: 0.0,
            phases,
            limits,
            strain_sd_scale: strain_sd_scale as f32,
            sieve: filter.sieve,
            zero: (DOUBT.zero * params.limits.span()) as f32,
            start_variance: (filter.known_sd * filter.known_sd) as f32,
            correction: filter.correction.as_ref(),
            quadratics: quadratics.as_ref(),
            doubt: filter.doubt,
            rest: filter.rest,
        };
        let longest_s = longest_step_s::<B, N, L>(&reference, &parts)? * STEP_GRACE;
        let usual_s = f64::from(dt_s) / (f64::from(dt_s) / longest_s).ceil().max(1.0);
        let kernel = |step_s| SparseEkf::<f64, Compact, B, N>::new(reference, step_s).map_err(parameter);
        let numbers = |step_s| exact_numbers(&reference, phases, step_s).map_err(parameter);
        let table = StepTable::new(usual_s, &kernel(usual_s)?.step_names(), numbers)?;
        // Not longer than the table either.
        // Not longer than the table either.
        parts.longest_step_s = (longest_s.min(table.range.1) / STEP_GRACE) as f32;
        let rest_reading = params.rest_reading as f32;
        let rested = params.rested() as f32;
        Ok(Self { reference, model, hypotheses: filter.hypotheses, rest_reading, rested, parts, table })
    }

    /// R₀ where the rested sensor reads this today.
    pub fn rest_reading_at(&self, measured: f32) -> f32 {
        self.rest_reading * (measured / self.rested)
    }

    /// What a live filter is made of beside the estimator.
    pub fn live_parts<'l, T: Real>(&self, learned: Option<(FeatureScale<T>, Learned<'l, T>)>) -> LiveParts<'l, T> {
        let exactly = |x: f32| number::<T>(x.into());
        let parts = &self.parts;
        let reading_sd = exactly(self.model.noise().reading_sd);
        LiveParts {
            rest_reading: exactly(self.rest_reading),
            rested: exactly(self.rested),
            dt_s: exactly(parts.dt_s),
            longest_step_s: exactly(parts.longest_step_s),
            limits: parts.limits_in(),
            strain_sd_scale: exactly(parts.strain_sd_scale),
            reading_variance: reading_sd * reading_sd,
            known_variance: exactly(parts.start_variance),
            sieve: parts.sieve.to(),
            doubt: parts.doubt.to(),
            rest: parts.rest.to(),
            learned,
        }
    }

    /// Whether a sensor that has just been rested may be unstretched.
    pub fn rests_at_zero(&self) -> bool {
        may_be_unstretched(&self.parts.limits)
    }

    /// Length of the last step that the usual time between readings is divided into, s.
    pub fn usual_step_s(&self) -> f32 {
        let mut pause = Pause::none(self.parts.longest_step_s).after(self.parts.dt_s);
        while pause.whole_step().is_some() {}
        pause.last_steps().1
    }

    /// Lengths of the whole steps of a pause, s.
    pub fn whole_steps_s(&self) -> Vec<f32> {
        let growth = STEP_GROWTH as f32;
        let lengths = std::iter::successors(Some(self.parts.longest_step_s), |length_s| Some(length_s * growth));
        lengths.take_while(|length_s| f64::from(*length_s) < LONGEST_PAUSE_S).collect()
    }

    /// What depends on the length of a step, as the exported program has it.
    pub fn interpolated(&self) -> Numbers<'_, f32> {
        let known: Vec<(f32, Vec<f32>)> = std::iter::once(self.usual_step_s())
            .chain(self.whole_steps_s())
            .map(|step_s| (step_s, self.numbers_at(step_s)))
            .collect();
        Box::new(move |step_s| {
            let known = known.iter().find(|(length_s, _)| *length_s == step_s);
            known.map_or_else(|| self.table.at(step_s), |(_, numbers)| numbers.clone())
        })
    }

    /// The same in double precision, as the law has it.
    pub fn exact(&self) -> Numbers<'_, f64> {
        Box::new(|step_s| {
            let numbers = exact_numbers(&self.reference, self.parts.phases, step_s);
            numbers.unwrap_or_else(|_| self.table.at(step_s))
        })
    }

    /// What depends on the length of a step, s, rounded.
    pub fn numbers_at(&self, step_s: f32) -> Vec<f32> {
        let numbers = exact_numbers(&self.reference, self.parts.phases, step_s.into());
        numbers.map_or_else(|_| self.table.at(step_s), |all| all.iter().map(|x| *x as f32).collect())
    }
}

/// Numbers of the kernel, and of the chain, for steps of a length.
fn exact_numbers<const B: usize, const N: usize>(
    model: &SwitchedModel<f64, B, N>,
    phases: Option<PhaseParts>,
    step_s: f64,
) -> Result<Vec<f64>, StepError> {
    let mut numbers = SparseEkf::<f64, Compact, B, N>::new(*model, step_s)?.step_numbers();
    let limits = StrainRange { lower: 0.0, upper: 1.0 };
    let chain = match phases {
        Some(phases) => phases.filter_parts::<f64>(limits)?.0.probabilities(step_s),
        None => [[0.0; 3]; 3],
    };
    numbers.extend(chain.as_flattened());
    Ok(numbers)
}

/// The longest step over which a prediction is as good as many short ones, s.
fn longest_step_s<const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<f64, B, N>,
    parts: &Parts<'_>,
) -> Result<f64, ExportError> {
    let limits = StrainRange { lower: f64::from(parts.limits.lower), upper: f64::from(parts.limits.upper) };
    let longest_s = match parts.phases {
        None => longest::<N, L>(&Ekf::new(*model)),
        Some(phases) => {
            let (dwell, evidence): (_, Evidence<f64>) = phases.filter_parts(limits).map_err(parameter)?;
            let hold = phases.rests.then_some(dwell);
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
