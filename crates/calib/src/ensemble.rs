use std::collections::VecDeque;
use std::ops::Range;

use arrayvec::ArrayVec;
use ohmstrain_ekf::{Estimate, Gaussian, Guard, Reading, ReadingVerdict, StepError};
use serde::{Deserialize, Serialize};

use crate::CalibrationError;
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::filter::{Filter, Output, Rows, WayBack};
use crate::inverse::{Inverse, InverseParams, InverseWayBack};
use crate::law_params::LawParams;

/// Estimators that run side by side, and how much each is listened to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnsembleParams {
    /// As for a single estimator.
    pub score: f64,
    /// As for a single estimator, on top of the members' own factors.
    pub strain_sd_scale: f64,
    /// The same for the smoother.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothed_sd_scale: Option<f64>,
    /// The members; their weights sum to one.
    pub members: Vec<MemberParams>,
    /// An inverse without a model, if one is listened to besides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverse: Option<InverseParams>,
}

/// A member of an ensemble.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberParams {
    /// What it is.
    pub estimator: EstimatorKind,
    /// How much it is listened to.
    pub weight: f64,
    /// A law of its own; without one it has the sensor's law, and the parameters that the sensor has for the estimator.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own: Option<OwnLaw>,
}

/// A law that differs from the sensor's, with what was fitted to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnLaw {
    /// R₀ of this law over the sensor's R₀.
    pub rest_ratio: f64,
    /// The law.
    pub law: LawParams,
    /// Noise and motion.
    pub parameters: EstimatorParams,
}

/// How many independent rows the mean score stands for: one. Errors hang together for as long as a movement lasts and the
/// score of one recording's blocks is a hint rather than a proof; a larger number lets a lucky member drown the others.
const INDEPENDENT_ROWS: f64 = 1.0;

/// Weights `∝ exp(-n · score)` of estimators with these mean negative log densities: pseudo-Bayesian model averaging
/// (Geisser & Eddy, *J. Am. Stat. Assoc.* 74 (1979) 153) on the blocks left out.
pub(crate) fn weights(scores: &[f64]) -> Vec<f64> {
    let best = scores.iter().copied().fold(f64::INFINITY, f64::min);
    let total: f64 = scores.iter().map(|score| relative_weight(*score, best)).sum();
    scores.iter().map(|score| relative_weight(*score, best) / total).collect()
}

/// The same of one more beside them, where their weights sum to one.
pub(crate) fn weight_beside(scores: &[f64], score: f64) -> f64 {
    let total: f64 = scores.iter().map(|member| relative_weight(*member, score)).sum();
    if total > 0.0 { 1.0 / total } else { 1.0 }
}

fn relative_weight(score: f64, to: f64) -> f64 {
    if score.is_finite() { (INDEPENDENT_ROWS * (to - score)).exp() } else { 0.0 }
}

/// Filters that run side by side, and an inverse for the strain alone. Their posteriors are pooled: where they disagree the
/// deviation grows. One that is surer than the others at the moment is listened to more, in proportion to 1/deviation.
pub(crate) struct Ensemble {
    members: Vec<Member>,
    inverse: Option<Inverse>,
    /// What the inverse has said of the rows that wait for a fixed lag.
    waiting: VecDeque<Option<Gaussian<f64>>>,
    filtered_scale: f64,
    smoothed_scale: f64,
}

struct Member {
    filter: Box<dyn Filter>,
    weight: f64,
    /// What it says at the moment, row by row.
    said: Vec<Output>,
}

/// Most members of an ensemble, with its inverse.
const MOST_VOICES: usize = 9;
/// What each of them says, with its weight.
type Few<X> = ArrayVec<(f64, X), MOST_VOICES>;

impl Ensemble {
    pub(crate) fn new(
        members: Vec<(Box<dyn Filter>, f64)>,
        inverse: Option<Inverse>,
        filtered_scale: f64,
        smoothed_scale: f64,
    ) -> Result<Self, CalibrationError> {
        if !(1..MOST_VOICES).contains(&members.len()) {
            let message = format!("an ensemble of {} members; 1 to {} are supported", members.len(), MOST_VOICES - 1);
            return Err(CalibrationError::Unsupported(message));
        }
        let members = members.into_iter().map(|(filter, weight)| Member { filter, weight, said: Vec::new() }).collect();
        Ok(Self { members, inverse, waiting: VecDeque::new(), filtered_scale, smoothed_scale })
    }

    /// What the inverse says at the moment, with its weight.
    fn inverse_now(&self) -> Option<(f64, Gaussian<f64>)> {
        self.inverse.as_ref().and_then(|inverse| Some((inverse.params.weight, inverse.now?)))
    }

    fn step_inverse(&mut self, time_s: f64, reading: Option<Reading<f64>>) {
        if let Some(inverse) = &mut self.inverse {
            inverse.step(time_s, reading);
        }
    }

    /// Lets every member do something; what each of them says is then in its `said`, call by call.
    fn let_act(
        &mut self,
        mut act: impl FnMut(&mut dyn Filter, &mut dyn FnMut(Output)) -> Result<(), StepError>,
    ) -> Result<(), StepError> {
        let mut acted = Ok(());
        for member in &mut self.members {
            member.said.clear();
            acted = acted.and(act(member.filter.as_mut(), &mut |output| member.said.push(output)));
        }
        acted
    }

    /// Pools what the members have said, row by row, with what the inverse said of those rows.
    fn hand_out(&mut self, out: &mut dyn FnMut(Output)) {
        let scale = self.filtered_scale.max(self.smoothed_scale);
        let weight = self.inverse.as_ref().map_or(0.0, |inverse| inverse.params.weight);
        let rows = self.members.iter().map(|member| member.said.len()).max().unwrap_or(0);
        for row in 0..rows {
            let said = |member: &Member| Some((member.weight, *member.said.get(row)?));
            let inverse = self.waiting.pop_front().flatten().map(|strain| (weight, strain));
            out(pooled(self.members.iter().filter_map(said).collect(), inverse, scale));
        }
    }
}

impl Filter for Ensemble {
    fn guard(&mut self, guard: Guard<f64>) {
        for member in &mut self.members {
            member.filter.guard(guard);
        }
        // It expects no reading in particular and would take every outlier.
        self.inverse = if guard.is_none() { self.inverse.take() } else { None };
    }

    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        // What a step is refused for lies in time and reading, which are the same for all: none goes ahead of the others.
        self.members.iter_mut().try_for_each(|member| member.filter.step(time_s, reading))?;
        self.step_inverse(time_s, reading);
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        let members = self.members.iter().map(|member| (member.weight, member.filter.strain()));
        let strains: Few<_> = members.chain(self.inverse_now()).collect();
        scaled(pooled_gaussian(&sure(strains, |strain| strain.sd()), |strain| *strain), self.filtered_scale)
    }

    fn output(&self) -> Output {
        let outputs = self.members.iter().map(|member| (member.weight, member.filter.output())).collect();
        pooled(outputs, self.inverse_now(), self.filtered_scale)
    }

    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError> {
        let acted = self.let_act(|filter, out| filter.step_lagged(time_s, reading, lag_s, out));
        if acted.is_ok() {
            self.step_inverse(time_s, reading);
            self.waiting.push_back(self.inverse.as_ref().and_then(|inverse| inverse.now));
        }
        self.hand_out(out);
        acted
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        let acted = self.let_act(|filter, out| filter.flush_lagged(out));
        self.hand_out(out);
        acted
    }

    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)> {
        let back = |member: &'a mut Member| Ok((member.weight, member.filter.way_back(rows)?, Vec::new()));
        let members = self.members.iter_mut().map(back).collect::<Result<_, _>>()?;
        let inverse = self.inverse.as_mut().map(|inverse| (inverse.way_back(rows), Vec::new()));
        Ok(Box::new(SideBySide { members, inverse, scale: self.smoothed_scale }))
    }
}

/// Members on their way back, segment by segment in step.
struct SideBySide<'a> {
    members: Vec<(f64, Box<dyn WayBack + 'a>, Vec<Output>)>,
    inverse: Option<(InverseWayBack<'a>, Vec<Option<Gaussian<f64>>>)>,
    scale: f64,
}

impl WayBack for SideBySide<'_> {
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        out.clear();
        let mut rows = None;
        for (_, back, said) in &mut self.members {
            let Some(segment) = back.next_segment(said)? else { return Ok(None) };
            rows = Some(segment);
        }
        if let Some((back, said)) = &mut self.inverse {
            back.next_segment(said);
        }
        for k in 0..rows.as_ref().map_or(0, Range::len) {
            let inverse = self.inverse.as_ref().and_then(|(back, said)| Some((back.smoothed_weight(), said[k]?)));
            let outputs = self.members.iter().map(|(weight, _, said)| (*weight, said[k])).collect();
            out.push(pooled(outputs, inverse, self.scale));
        }
        Ok(rows)
    }
}

fn scaled(gaussian: Gaussian<f64>, sd_scale: f64) -> Gaussian<f64> {
    Gaussian { variance: gaussian.variance * sd_scale * sd_scale, ..gaussian }
}

/// The same with every weight divided by a deviation, and a sum of one.
fn sure<X>(mut weighted: Few<X>, sd: impl Fn(&X) -> f64) -> Few<X> {
    let smallest = weighted.iter().map(|(_, x)| sd(x)).fold(f64::INFINITY, f64::min);
    let share = |x: &X| if sd(x) > 0.0 { smallest / sd(x) } else { 1.0 };
    let total: f64 = weighted.iter().map(|(weight, x)| weight * share(x)).sum();
    for (weight, x) in &mut weighted {
        *weight = *weight * share(x) / total;
    }
    weighted
}

/// Mean and variance of a mixture of Gaussians whose weights sum to one.
fn pooled_gaussian<X>(weighted: &[(f64, X)], of: impl Fn(&X) -> Gaussian<f64>) -> Gaussian<f64> {
    let mean: f64 = weighted.iter().map(|(weight, x)| weight * of(x).mean).sum();
    let spread = |x: &X| of(x).variance + (of(x).mean - mean).powi(2);
    Gaussian { mean, variance: weighted.iter().map(|(weight, x)| weight * spread(x)).sum() }
}

/// What the members say together, and of the strain with the inverse.
fn pooled(outputs: Few<Output>, inverse: Option<(f64, Gaussian<f64>)>, strain_sd_scale: f64) -> Output {
    let strains = outputs.iter().map(|(weight, output)| (*weight, output.estimate.strain)).chain(inverse).collect();
    let strain = pooled_gaussian(&sure(strains, Gaussian::sd), |strain| *strain);
    let outputs = &sure(outputs, |output| output.estimate.strain.sd());
    let gaussian = |of: fn(&Estimate<f64>) -> Gaussian<f64>| pooled_gaussian(outputs, |output| of(&output.estimate));
    let mean = |of: &dyn Fn(&Output) -> f64| outputs.iter().map(|(weight, output)| weight * of(output)).sum::<f64>();
    let share = |holds: &dyn Fn(&Output) -> bool| mean(&|output| f64::from(u8::from(holds(output)))) > 0.5;
    Output {
        estimate: Estimate {
            strain: scaled(strain, strain_sd_scale),
            rate: gaussian(|estimate| estimate.rate),
            relaxation: gaussian(|estimate| estimate.relaxation),
            baseline: mean(&|output| output.estimate.baseline),
            settled: gaussian(|estimate| estimate.settled),
            beyond_border: mean(&|output| output.estimate.beyond_border),
            near_ramp_border: share(&|output| output.estimate.near_ramp_border),
        },
        nis: outputs.iter().map(|(weight, output)| Some(weight * output.nis?)).sum(),
        verdict: majority(outputs),
        phases: pooled_phases(outputs),
    }
}

/// The verdict with the most weight behind it.
fn majority(outputs: &[(f64, Output)]) -> ReadingVerdict {
    let weight_of = |verdict: ReadingVerdict| {
        outputs.iter().filter(|(_, output)| output.verdict == verdict).map(|(weight, _)| weight).sum::<f64>()
    };
    let verdicts = outputs.iter().map(|(_, output)| output.verdict);
    verdicts.max_by(|a, b| weight_of(*a).total_cmp(&weight_of(*b))).unwrap_or(ReadingVerdict::Missing)
}

/// Phase probabilities of the members that have phases.
fn pooled_phases(outputs: &[(f64, Output)]) -> Option<[f64; 3]> {
    let known = || outputs.iter().filter_map(|(weight, output)| Some((weight, output.phases?)));
    let total: f64 = known().map(|(weight, _)| weight).sum();
    let probability = |phase: usize| known().map(|(weight, phases)| weight * phases[phase]).sum::<f64>() / total;
    (total > 0.0).then(|| std::array::from_fn(probability))
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::Gaussian;

    use super::{pooled_gaussian, sure, weight_beside, weights};

    #[test]
    fn disagreement_widens() {
        // Two of ±1 with equal weights: variance 1 between them on top of their own.
        let at = |mean: f64| (0.5, Gaussian { mean, variance: 0.25 });
        let pooled = pooled_gaussian(&[at(-1.0), at(1.0)], |gaussian| *gaussian);
        assert_eq!((pooled.mean, pooled.variance), (0.0, 1.25));
    }

    #[test]
    fn the_surer_member_counts_more() {
        let at = |sd: f64| (0.5, Gaussian { mean: 0.0, variance: sd * sd });
        let weights = |members: [(f64, Gaussian<f64>); 2]| {
            sure(members.into_iter().collect(), |gaussian| gaussian.sd())
                .iter()
                .map(|(weight, _)| *weight)
                .collect::<Vec<f64>>()
        };
        assert_eq!(weights([at(1.0), at(3.0)]), [0.75, 0.25]);
        // Exact knowledge drowns the rest.
        assert_eq!(weights([at(0.0), at(3.0)]), [1.0, 0.0]);
    }

    #[test]
    fn weights_follow_the_scores() {
        let scores = [-2.0, f64::INFINITY, -2.5];
        let weights = weights(&scores);
        assert!((weights[0] + weights[2] - 1.0).abs() < 1e-15);
        assert!((weights[2] / weights[0] - 0.5_f64.exp()).abs() < 1e-12);
        assert_eq!(weights[1], 0.0);
        // One as good as the first: what that is of the sum.
        assert!((weight_beside(&scores, -2.0) - 1.0 / (1.0 + 0.5_f64.exp())).abs() < 1e-12);
    }
}
