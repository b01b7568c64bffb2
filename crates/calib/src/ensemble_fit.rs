use std::collections::BTreeMap;

use crate::CalibrationError;
use crate::ensemble::{self, Ensemble, EnsembleParams, MemberParams, OwnLaw};
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::filter::{Filter, Setting, Start, filter_from_parts};
use crate::law_fit::{CrossFit, LawFit, LawOptions, MOST_BRANCHES, fit_laws};
use crate::left_out::{Fold, LeftOut};
use crate::motion_stats::MotionStats;
use crate::noise_fit::{Effort, NoiseProblem, SMOOTHED_ROWS, Tuned, stride};
use crate::own_rest::OwnRest;
use crate::samples::Samples;
use crate::sd_scale::sd_scale;

/// The estimator that runs a second time, under a law with one branch more: the one whose law limits it most.
pub(crate) const RICHER: EstimatorKind = EstimatorKind::SignSplit;
/// Of every member.
const EFFORT: Effort = Effort::SHARED;

/// Laws with one branch more than these options ask for, one per strength of ridge; none where no such law fits or no
/// filter is built for it, which is no reason not to calibrate.
///
/// Which number of branches is right hardly shows in one recording, and is the law's own error: estimators that agree on it
/// are wrong together. With members of both kinds the error shows as disagreement, and part of it averages out: on halves of
/// nine recordings the pooled error fell from 0.39 of the static cubic's to 0.35, with the same searches.
pub(crate) fn richer_laws(recordings: &[Samples], options: LawOptions) -> Vec<CrossFit> {
    let richer = LawOptions { branches: options.branches + 1, ..options };
    if richer.branches > MOST_BRANCHES {
        return Vec::new();
    }
    fit_laws(recordings, richer).unwrap_or_default()
}

/// Evaluations to expect of [`richer_member`].
pub(crate) const fn richer_evaluations(laws: usize) -> u64 {
    if laws == 0 { 0 } else { laws as u64 * EFFORT.resurvey.evaluations() + EFFORT.refinement.evaluations() }
}

/// The law of these that the estimator does best with, and noise and motion fitted to it, from where the search under the
/// sensor's law has led to.
pub(crate) fn richer_member<'a>(
    recordings: &[Samples],
    laws: &'a [CrossFit],
    stats: MotionStats,
    from: &Tuned,
    evaluated: &mut dyn FnMut(),
) -> Result<Option<(&'a CrossFit, EstimatorParams)>, CalibrationError> {
    let mut best: Option<(&CrossFit, Tuned)> = None;
    for law in laws {
        let problem = NoiseProblem::new(recordings, law, stats, RICHER, EFFORT);
        let tuned = problem.search(Some(from), EFFORT.resurvey, &mut *evaluated)?;
        if best.as_ref().is_none_or(|(_, best)| tuned.cost < best.cost) {
            best = Some((law, tuned));
        }
    }
    let Some((law, tuned)) = best else { return Ok(None) };
    let problem = NoiseProblem::new(recordings, law, stats, RICHER, EFFORT);
    let tuned = problem.search(Some(&tuned), EFFORT.refinement, evaluated)?;
    Ok(Some((law, problem.finish(&tuned))))
}

/// A member before it is weighed; `own` is its law if that is not the sensor's.
#[derive(Clone, Copy)]
pub(crate) struct Candidate<'a> {
    pub estimator: EstimatorKind,
    pub parameters: &'a EstimatorParams,
    pub own: Option<&'a CrossFit>,
}

/// The ensemble's estimators under the sensor's law, and one more under a law of its own.
pub(crate) fn candidates<'a>(
    estimators: &'a BTreeMap<EstimatorKind, EstimatorParams>,
    richer: Option<&'a (&'a CrossFit, EstimatorParams)>,
) -> Vec<Candidate<'a>> {
    let shared = EstimatorKind::Ensemble
        .members()
        .iter()
        .filter_map(|&estimator| Some(Candidate { estimator, parameters: estimators.get(&estimator)?, own: None }));
    let own = richer.map(|(law, parameters)| Candidate { estimator: RICHER, parameters, own: Some(*law) });
    shared.chain(own).collect()
}

/// Weighs the members by their scores and scales the ensemble's deviations as those of a single estimator. `fit` is the
/// sensor's law.
pub(crate) fn fit_ensemble(recordings: &[Samples], fit: &CrossFit, candidates: &[Candidate]) -> EnsembleParams {
    let scores: Vec<_> = candidates.iter().map(|candidate| (candidate.estimator, candidate.parameters.score)).collect();
    let weights = ensemble::weights(&scores);
    let limits = fit.law.law.range;
    let build = |fold: Fold| -> Result<Box<dyn Filter>, CalibrationError> {
        let member = |(candidate, weight): (&Candidate, &f64)| Ok((candidate.build(fold)?, *weight));
        let members = candidates.iter().zip(&weights).map(member).collect::<Result<_, CalibrationError>>()?;
        Ok(Box::new(Ensemble::new(members, 1.0, 1.0)?))
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
    }
}

impl Candidate<'_> {
    /// Its filter for a block that its law has not seen either.
    fn build(&self, fold: Fold) -> Result<Box<dyn Filter>, CalibrationError> {
        let (law, own_rest) = match self.own.and_then(|own| own.without_block.get(fold.block)) {
            None => (fold.law, OwnRest::SHARED),
            Some(own) => (&own.law, OwnRest::new(own.rest_readings[fold.recording] / fold.rest_reading)),
        };
        let setting = Setting { limits: fold.law.range, start: Start::Unknown, own_rest };
        filter_from_parts(self.estimator, law, self.parameters, setting)
    }
}

/// R₀ of one law over that of another, the median over recordings.
fn rest_ratio(own: &LawFit, of: &LawFit) -> f64 {
    let mut ratios: Vec<f64> = own.rest_readings.iter().zip(&of.rest_readings).map(|(a, b)| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}
