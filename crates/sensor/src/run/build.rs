use std::sync::Arc;

use ohmstrain_ekf::correction::FeatureScale;
use ohmstrain_ekf::live::{
    DoubtParts, LiveParts, Protections, RestBounds, SensorEstimator, Sieve, StaticCurve, Unread,
};
use ohmstrain_ekf::{
    AnyCurve, Compact, Dwell, Evidence, Hypotheses, Imm, PlainState, Settling, SigmaPoints, SignSplit, SparseEkf, State,
};
use ohmstrain_model::{StrainRange, SwitchedModel};

use crate::params::SensorParams;
use crate::params::estimator::{EstimatorKind, EstimatorParams, NoParameters};
use crate::params::law::LawParams;
use crate::run::learned::Learned;
use crate::run::options::Options;
use crate::run::remembering::Remembering;
use crate::run::running::{Reports, Running, SharedCorrection};
use crate::run::{Filter, Smoother, Start};
use crate::{SensorError, with_sizes};

/// Standard deviation of a given initial strain, as a fraction of the limits' span.
const START_SD: f64 = 1e-3;

/// Builds a filter for a sensor with the plausibility check of readings, and no other protection.
///
/// # Errors
/// If a number is out of its range, the sensor has no parameters for the estimator, or its number of branches is not
/// supported.
pub fn build_filter(
    params: &SensorParams,
    kind: Option<EstimatorKind>,
    start: Start,
) -> Result<Box<dyn Filter>, SensorError> {
    let options =
        Options { start, protections: Protections { plausibility: true, ..Protections::NONE }, ..Options::plain() };
    build_filter_with(params, Learned::of(params).as_ref(), kind, &options)
}

/// Builds a filter that shares a sensor's correction, [`Learned::of`] these parameters, with other filters.
///
/// # Errors
/// As [`build_filter`].
pub fn build_filter_with(
    params: &SensorParams,
    learned: Option<&Arc<Learned>>,
    kind: Option<EstimatorKind>,
    options: &Options,
) -> Result<Box<dyn Filter>, SensorError> {
    let kind = kind.unwrap_or(params.default_estimator);
    let recipe = FilterParts::of(params, kind, *options)?;
    recipe.filter(needed(learned, kind)?)
}

/// Builds a smoother with its learned correction. It ignores three options: following R₀, second looks and doubts.
///
/// # Errors
/// As [`build_filter`].
pub fn build_smoother_with(
    params: &SensorParams,
    learned: Option<&Arc<Learned>>,
    kind: Option<EstimatorKind>,
    options: &Options,
) -> Result<Box<dyn Smoother>, SensorError> {
    let kind = kind.unwrap_or_else(|| params.smoother_of(params.default_estimator));
    let recipe = FilterParts::of(params, kind, *options)?;
    recipe.smoother(needed(learned, kind)?)
}

/// Returns the learned correction if the estimator needs one.
fn needed(learned: Option<&Arc<Learned>>, kind: EstimatorKind) -> Result<Option<&Arc<Learned>>, SensorError> {
    if kind != EstimatorKind::Corrected {
        return Ok(None);
    }
    Ok(Some(learned.ok_or(NoParameters { kind })?))
}

/// Parts of a filter without its correction.
#[derive(Clone, Copy)]
pub struct FilterParts<'a> {
    /// Kind of filter, never [`EstimatorKind::Corrected`] or [`EstimatorKind::StaticCubic`].
    kind: EstimatorKind,
    law: &'a LawParams,
    estimator: EstimatorParams,
    parts: LiveParts<f64, ()>,
    /// Curve that gives the strain in place of the filter.
    curve: Option<StaticCurve<f64>>,
    options: Options,
    /// Factor on the longest step between readings.
    step_factor: f64,
}

impl<'a> FilterParts<'a> {
    /// Collects the parts of a calibrated sensor's filter.
    fn of(params: &'a SensorParams, kind: EstimatorKind, options: Options) -> Result<Self, SensorError> {
        params.validate()?;
        let curve = params.curve_of(kind)?;
        let kind = params.filter_of(kind);
        let estimator = *params.estimator(kind)?;
        let parts = params.live_parts(&estimator);
        Ok(Self { kind, law: &params.law, estimator, parts, curve, options, step_factor: 1.0 })
    }

    /// Collects the parts of a filter for a law that is being calibrated, when nothing is known yet about the readings.
    pub fn of_law(
        kind: EstimatorKind,
        law: &'a LawParams,
        estimator: EstimatorParams,
        limits: StrainRange<f64>,
    ) -> Self {
        let parts = bare_parts(&estimator, limits);
        Self { kind, law, estimator, parts, curve: None, options: Options::plain(), step_factor: 1.0 }
    }

    /// Sets a curve that gives the strain in place of the filter.
    #[must_use]
    pub fn on_curve(self, curve: Option<StaticCurve<f64>>) -> Self {
        Self { curve, ..self }
    }

    /// Takes steps of up to `factor` times the longest step between readings, which is faster and less exact.
    #[must_use]
    pub fn in_longer_steps(self, factor: f64) -> Self {
        Self { step_factor: factor, ..self }
    }

    /// Sets other options.
    #[cfg(test)]
    pub(crate) fn with(self, options: Options) -> Self {
        Self { options, ..self }
    }

    /// Builds the filter, with the learned correction if there is one.
    pub fn filter(self, learned: Option<&Arc<Learned>>) -> Result<Box<dyn Filter>, SensorError> {
        Ok(self.running(self.parts.with_correction(learned.map(of_filter)), None)?)
    }

    /// Builds the smoother, with the learned correction if there is one.
    pub fn smoother(self, learned: Option<&Arc<Learned>>) -> Result<Box<dyn Smoother>, SensorError> {
        let given = self.options.protections;
        let protections = Protections { second_look: false, following: false, doubts: false, ..given };
        let of_smoother = Self { options: Options { protections, ..self.options }, ..self };
        Ok(of_smoother.running(self.parts.with_correction(learned.map(of_filter)), learned.cloned())?)
    }

    fn running(
        self,
        parts: LiveParts<f64, SharedCorrection>,
        learned: Option<Arc<Learned>>,
    ) -> Result<Box<dyn Both>, SensorError> {
        let branches = self.law.branches.len();
        #[cfg(not(test))]
        let built = with_sizes!(branches, B, N, L => self.of_size::<B, N, L>(parts, learned));
        // Laws of unit tests have no branches, which takes a fifth of the instances.
        #[cfg(test)]
        let built = with_sizes!(@ branches, B, N, L, self.of_size::<B, N, L>(parts, learned), 0);
        built.unwrap_or_else(|| Err(SensorError::Branches { found: branches }))
    }

    /// Builds any filter of a model of known size.
    fn of_size<const B: usize, const N: usize, const L: usize>(
        self,
        parts: LiveParts<f64, SharedCorrection>,
        learned: Option<Arc<Learned>>,
    ) -> Result<Box<dyn Both>, SensorError> {
        let Self { kind, law, ref estimator, curve, options, step_factor, .. } = self;
        let model = switched::<B, N>(law, estimator)?;
        let refused = SensorError::Start;
        let reports = Reports { curve, ..reports(estimator, model, &parts.limits, &options) };
        let limits = parts.limits;
        let with = With { parts, reports, learned, options, step_factor };
        Ok(match kind {
            EstimatorKind::Ekf => with.run::<_, L>(SparseEkf::<_, Compact, B, N>::at_a_moment(model).map_err(refused)?),
            EstimatorKind::Ukf => {
                let filter = SparseEkf::<_, Compact, B, N, SigmaPoints<AnyCurve<f64>>>::at_a_moment(model);
                with.run::<_, L>(filter.map_err(refused)?)
            }
            EstimatorKind::Corrected | EstimatorKind::StaticCubic => return Err(NoParameters { kind }.into()),
            EstimatorKind::Imm => {
                let PhaseFilter { dwell, evidence, .. } = PhaseFilter::new(kind, estimator, limits)?;
                with.run::<_, L>(Imm::<_, B, N>::new(model, NO_STEP_S, dwell, evidence).map_err(refused)?)
            }
            EstimatorKind::SignSplit => {
                let PhaseFilter { hold, evidence, .. } = PhaseFilter::new(kind, estimator, limits)?;
                let filter = SignSplit::<_, B, N, HYPOTHESES>::new(model, NO_STEP_S, hold, evidence);
                with.run::<_, L>(filter.map_err(refused)?)
            }
            EstimatorKind::Hypotheses => {
                let PhaseFilter { dwell, evidence, .. } = PhaseFilter::new(kind, estimator, limits)?;
                let filter = Hypotheses::<_, B, N, HISTORIES>::new(model, NO_STEP_S, dwell, evidence);
                with.run::<_, L>(filter.map_err(refused)?)
            }
        })
    }
}

/// Returns the correction of the filter, and the scale of its features.
fn of_filter(learned: &Arc<Learned>) -> (FeatureScale<f64>, SharedCorrection) {
    (learned.readings, SharedCorrection(Arc::clone(&learned.filter)))
}

/// Components around an estimator.
struct With<const B: usize, const N: usize> {
    parts: LiveParts<f64, SharedCorrection>,
    reports: Reports<B, N>,
    learned: Option<Arc<Learned>>,
    options: Options,
    step_factor: f64,
}

impl<const B: usize, const N: usize> With<B, N> {
    fn run<E, const L: usize>(self, estimator: E) -> Box<dyn Both>
    where
        E: SensorEstimator<f64, N, L, Prepared: Send> + Send + 'static,
        E::State: State<f64, N, L> + PlainState<f64> + Send,
    {
        let estimator = Remembering::new(estimator, self.step_factor);
        Box::new(Running::new(estimator, self.parts, self.reports, self.learned, &self.options))
    }
}

/// Filter and smoother with the same estimator.
trait Both: Filter + Smoother {}
impl<R: Filter + Smoother> Both for R {}

/// Builds the model of a law.
fn switched<const B: usize, const N: usize>(
    law: &LawParams,
    estimator: &EstimatorParams,
) -> Result<SwitchedModel<f64, B, N>, SensorError> {
    let law = law.to_model().ok_or(SensorError::Branches { found: law.branches.len() })?;
    let mut motion = estimator.motion.to_model()?;
    if let Some(phases) = estimator.phases {
        motion = motion.with_phase_rate(phases.speed_per_s)?;
    }
    Ok(SwitchedModel::new(law, motion, estimator.noise.to_model())?)
}

/// Parameters, besides the model, of filters with phase hypotheses.
struct PhaseFilter {
    dwell: Dwell<f64>,
    /// The same, for a body that sometimes rests.
    hold: Option<Dwell<f64>>,
    evidence: Evidence<f64>,
}

impl PhaseFilter {
    fn new(kind: EstimatorKind, estimator: &EstimatorParams, limits: StrainRange<f64>) -> Result<Self, SensorError> {
        let phases = estimator.phases.ok_or(SensorError::NoPhases { kind })?;
        let dwell = phases.dwell()?;
        let hold = phases.rests().then_some(dwell);
        Ok(Self { dwell, hold, evidence: Evidence::new(limits, phases.tempering)? })
    }
}

/// Returns scales, limits and settling of the reports.
fn reports<const B: usize, const N: usize>(
    estimator: &EstimatorParams,
    model: SwitchedModel<f64, B, N>,
    limits: &StrainRange<f64>,
    options: &Options,
) -> Reports<B, N> {
    let unseen = || Settling::unseen(&estimator.noise.to_model(), B);
    Reports {
        model,
        limits: *limits,
        curve: None,
        settling: estimator.settling.unwrap_or_else(unseen),
        filtered_scale: estimator.strain_sd_scale,
        smoothed_scale: estimator.smoothed_sd_scale.unwrap_or(1.0),
        doubts: options.protections.doubts,
    }
}

/// Components around a filter of readings R/R₀ for which only the limits of the strain are known.
fn bare_parts(estimator: &EstimatorParams, limits: StrainRange<f64>) -> LiveParts<f64, ()> {
    let EstimatorParams { motion, noise, .. } = estimator;
    let unread = Unread::new(motion.rate_time_s, motion.rate_sd_per_s, limits);
    let doubt = DoubtParts {
        low: 0.0,
        high: 0.0,
        fastest_per_s: f64::INFINITY,
        longest_s: f64::INFINITY,
        per_reading: 0.0,
        start: 0.0,
        most: unread.anywhere,
        unstated: 0.0,
        unread,
        rest: None,
        turns: None,
    };
    LiveParts {
        rest_reading: 1.0,
        rested: 1.0,
        dt_s: 0.0,
        longest_step_s: f64::INFINITY,
        limits,
        strain_sd_scale: estimator.strain_sd_scale,
        reading_variance: noise.reading_sd * noise.reading_sd,
        known_variance: (START_SD * limits.span()).powi(2),
        sieve: Sieve::open().with_error_time(noise.reading_time_s),
        doubt,
        rest: RestBounds { low: None, high: None, start: None },
        learned: None,
    }
}

impl SensorParams {
    /// Returns the curve that gives an estimator's strain, if one does.
    pub(crate) fn curve_of(&self, kind: EstimatorKind) -> Result<Option<StaticCurve<f64>>, NoParameters> {
        if kind != EstimatorKind::StaticCubic {
            return Ok(None);
        }
        self.static_cubic.curve(self.rest_reading).map(Some).ok_or(NoParameters { kind })
    }

    /// Components around the filter with that estimator, without a correction.
    pub(crate) fn live_parts(&self, estimator: &EstimatorParams) -> LiveParts<f64, ()> {
        LiveParts {
            rest_reading: self.rest_reading,
            rested: self.rested(),
            sieve: self.sieve().with_error_time(estimator.noise.reading_time_s),
            doubt: self.filters_doubts(&estimator.motion),
            rest: self.rest_bounds(),
            ..bare_parts(estimator, self.limits)
        }
    }
}

/// Step length, s, for which filters are built before the real one is known.
const NO_STEP_S: f64 = 0.0;

/// Capacity of the sign-split filter.
pub const HYPOTHESES: usize = 8;
/// Capacity of the filter of phase histories.
pub const HISTORIES: usize = 8;
