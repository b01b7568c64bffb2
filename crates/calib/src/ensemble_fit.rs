use std::collections::BTreeMap;

use crate::CalibrationError;
use crate::build_filter::{Setting, filter_from_parts};
use crate::ensemble::{self, Ensemble, EnsembleParams, MemberParams, OwnLaw};
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::filter::{Filter, Start};
use crate::inverse::Inverse;
use crate::inverse_fit::{InverseFit, fit_inverse};
use crate::law_fit::{CrossFit, LawFit, LawOptions, MOST_BRANCHES, fit_laws};
use crate::left_out::{Fold, LeftOut};
use crate::motion_stats::MotionStats;
use crate::noise_fit::{NoiseProblem, REFINEMENT, SMOOTHED_ROWS, Surveyed, stride, survey, survey_evaluations};
use crate::own_rest::OwnRest;
use crate::samples::Samples;
use crate::sd_scale::sd_scale;
use crate::sieve::Sieve;

/// The estimator that runs under laws of its own: the one whose law limits it most.
const RICHER: EstimatorKind = EstimatorKind::SignSplit;

/// Laws with one branch more than the sensor's, one per strength of ridge; none where no such law fits or no filter is built
/// for it, which is no reason not to calibrate.
///
/// Which number of branches is right hardly shows in one recording, and is the law's own error: estimators that agree on it
/// are wrong together. With both numbers the error shows as disagreement, and part of it averages out. Where every member has
/// the number that it scores best with, most have the same one, and that is lost.
pub(crate) fn richer_laws(recordings: &[Samples], structures: &[LawOptions], fit: &CrossFit) -> Vec<CrossFit> {
    let of_fit = structures.iter().find(|structure| structure.branches == fit.branches());
    let richer = of_fit.map(|structure| LawOptions { branches: structure.branches + 1, ..*structure });
    let supported = richer.filter(|richer| richer.branches <= MOST_BRANCHES);
    supported.and_then(|richer| fit_laws(recordings, &[richer]).ok()).unwrap_or_default()
}

/// A member with a law of its own.
pub(crate) type Richer<'a> = (&'a CrossFit, EstimatorParams);

/// Evaluations to expect of [`richer_members`] with so many laws.
pub(crate) fn richer_evaluations(laws: usize) -> u64 {
    let families = RICHER.motion_families().len() as u64;
    survey_evaluations(RICHER, laws, 1) + families * REFINEMENT.evaluations()
}

/// One member per family of motions, each with the law of these that it does best with.
pub(crate) fn richer_members<'a>(
    recordings: &[Samples],
    laws: &'a [CrossFit],
    stats: MotionStats,
    evaluated: &mut dyn FnMut(),
) -> Result<Vec<Richer<'a>>, CalibrationError> {
    let laws: Vec<&CrossFit> = laws.iter().collect();
    let surveyed = survey(recordings, &laws, stats, RICHER, &mut *evaluated)?;
    let mut members = Vec::new();
    for &family in RICHER.motion_families() {
        let of_family = surveyed.iter().filter(|one| one.family == family);
        if let Some(Surveyed { law, tuned, .. }) = of_family.min_by(|a, b| a.tuned.cost.total_cmp(&b.tuned.cost)) {
            let problem = NoiseProblem::new(recordings, law, stats, (RICHER, family));
            members.push((*law, problem.refine(tuned, &mut *evaluated)?));
        }
    }
    Ok(members)
}

/// A member before it is weighed; `own` is its law if that is not the sensor's.
#[derive(Clone, Copy)]
pub(crate) struct Candidate<'a> {
    pub estimator: EstimatorKind,
    pub parameters: &'a EstimatorParams,
    pub own: Option<&'a CrossFit>,
}

/// The ensemble's estimators under the sensor's law, and those under laws of their own.
pub(crate) fn candidates<'a>(
    estimators: &'a BTreeMap<EstimatorKind, EstimatorParams>,
    richer: &'a [Richer<'a>],
) -> Vec<Candidate<'a>> {
    let shared = EstimatorKind::Ensemble
        .members()
        .iter()
        .filter_map(|&estimator| Some(Candidate { estimator, parameters: estimators.get(&estimator)?, own: None }));
    let own = richer.iter().map(|(law, parameters)| Candidate { estimator: RICHER, parameters, own: Some(*law) });
    shared.chain(own).collect()
}

/// Weighs the members by their scores and scales the ensemble's deviations as those of a single estimator. `fit` is the
/// sensor's law.
pub(crate) fn fit_ensemble(recordings: &[Samples], fit: &CrossFit, candidates: &[Candidate]) -> EnsembleParams {
    let scores: Vec<f64> = candidates.iter().map(|candidate| candidate.parameters.score).collect();
    let weights = ensemble::weights(&scores);
    let limits = fit.law.law.range;
    let inverse = weighed_inverse(recordings, fit, &scores);
    let build = |fold: Fold| -> Result<Box<dyn Filter>, CalibrationError> {
        let member = |(candidate, weight): (&Candidate, &f64)| Ok((candidate.build(fold)?, *weight));
        let members = candidates.iter().zip(&weights).map(member).collect::<Result<_, CalibrationError>>()?;
        let inverse = inverse.as_ref().map(|inverse| {
            let own_rest = OwnRest::new(fit.law.rest_readings[fold.recording] / fold.rest_reading);
            Inverse::new(inverse.without_block[fold.block].clone(), limits, own_rest)
        });
        Ok(Box::new(Ensemble::new(members, inverse.transpose()?, 1.0, 1.0)?))
    };
    let left_out = LeftOut::new(recordings, fit, limits, 1);
    let thinned = LeftOut::new(recordings, fit, limits, stride(recordings, SMOOTHED_ROWS));
    let members = candidates.iter().zip(&weights).map(|(candidate, &weight)| MemberParams {
        estimator: candidate.estimator,
        weight,
        own: candidate.own.map(|own| OwnLaw {
            rest_ratio: rest_ratio(&own.law, &fit.law),
            law: own.law.law.clone(),
            parameters: *candidate.parameters,
        }),
    });
    EnsembleParams {
        score: left_out.score(&build),
        strain_sd_scale: left_out.filtered_deviations(&build).map_or(1.0, |deviations| sd_scale(&deviations)),
        smoothed_sd_scale: thinned.smoothed_deviations(&build).map(|deviations| sd_scale(&deviations)),
        members: members.collect(),
        inverse: inverse.map(|inverse| inverse.params),
    }
}

/// The inverse beside members with these scores.
fn weighed_inverse(recordings: &[Samples], fit: &CrossFit, scores: &[f64]) -> Option<InverseFit> {
    let mut inverse = fit_inverse(recordings, fit)?;
    let span = fit.law.law.range.span();
    let weight = ensemble::weight_beside(scores, inverse.params.filter.score(span));
    let smoothed_weight = ensemble::weight_beside(scores, inverse.params.smoother.score(span));
    for params in inverse.without_block.iter_mut().chain([&mut inverse.params]) {
        (params.weight, params.smoothed_weight) = (weight, smoothed_weight);
    }
    Some(inverse)
}

impl Candidate<'_> {
    /// Its filter for a block that its law has not seen either.
    fn build(&self, fold: Fold) -> Result<Box<dyn Filter>, CalibrationError> {
        let (law, own_rest) = match self.own.and_then(|own| own.without_block.get(fold.block)) {
            None => (fold.law, OwnRest::SHARED),
            Some(own) => (&own.law, OwnRest::new(own.rest_readings[fold.recording] / fold.rest_reading)),
        };
        let setting = Setting { limits: fold.law.range, start: Start::Unknown, own_rest, sieve: Sieve::OPEN };
        filter_from_parts(self.estimator, law, self.parameters, setting)
    }
}

/// R₀ of one law over that of another, the median over recordings.
fn rest_ratio(own: &LawFit, of: &LawFit) -> f64 {
    let mut ratios: Vec<f64> = own.rest_readings.iter().zip(&of.rest_readings).map(|(a, b)| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}
