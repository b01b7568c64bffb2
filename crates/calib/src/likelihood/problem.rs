use super::sensor::{found, warnings};
use super::sensor_family::SensorFamily;
use super::{
    Likelihood, LikelihoodFit, ModelFamily, NoiseFit, NoiseParameter, NoiseStart, Parameter, ProfileInterval,
    ReadingSeries, ReadingsLikelihood,
};
use crate::CalibrationError;
use crate::optimise::{Ends, nelder_mead};
use ohmstrain_sensor::LawParams;

/// The likelihood of readings `R/R₀ - 1` under the extended Kalman filter of a known law, as a function of the parameters in `free`, each
/// within a factor of a thousand of its start.
///
/// The strain is not needed. In exchange the law is assumed to be exact: its error is attributed to the noise that fits it best.
#[derive(Clone, Copy, Debug)]
pub struct LikelihoodProblem<'a> {
    /// Recordings; the filter restarts for each.
    pub recordings: &'a [ReadingSeries<'a>],
    /// The law; at most four branches.
    pub law: &'a LawParams,
    /// Initial noise and motion.
    pub start: &'a NoiseStart,
    /// Free parameters; none of them starts at zero.
    pub free: &'a [NoiseParameter],
}

/// Builds the likelihood in the size of a problem's law, and evaluates an expression on it.
macro_rules! asked {
    ($problem:expr, $likelihood:ident => $answer:expr) => {{
        let (parameters, branches) = ($problem.parameters(), $problem.law.branches.len());
        ohmstrain_sensor::with_sizes!(branches, B, N, L => {
            let family = &$problem.family::<B>()?;
            let $likelihood = Likelihood::<_, N, L> { family, parameters: &parameters, recordings: $problem.recordings };
            $answer
        })
        .unwrap_or_else(|| Err(ohmstrain_sensor::SensorError::Branches { found: branches }.into()))
    }};
}

impl LikelihoodProblem<'_> {
    /// Returns the log-likelihood at the start.
    ///
    /// # Errors
    /// As [`Self::fit`].
    pub fn log_likelihood(&self) -> Result<ReadingsLikelihood<f64>, CalibrationError> {
        let start: Vec<f64> = self.parameters().iter().map(|parameter| parameter.start).collect();
        asked!(self, likelihood => likelihood.log_likelihood(&start))
    }

    /// Finds the noise and motion that maximise the likelihood of the readings.
    ///
    /// # Errors
    /// If nothing is free, a free parameter starts at zero, the law is not supported, or the filter fails.
    pub fn fit(&self) -> Result<NoiseFit, CalibrationError> {
        if self.free.is_empty() {
            return Err(CalibrationError::Unsupported("no parameter is free".into()));
        }
        let fit = asked!(self, likelihood => maximum(&likelihood))?;
        let (noise, motion) = found(self.start, self.free, &fit);
        Ok(NoiseFit { noise, motion, warnings: warnings(&fit), fit })
    }

    /// Returns [`Likelihood::profile_interval`] of parameter `index` in `free` around the maximum.
    ///
    /// # Errors
    /// If the law is not supported.
    pub fn profile_interval(&self, fit: &LikelihoodFit, index: usize) -> Result<ProfileInterval, CalibrationError> {
        asked!(self, likelihood => Ok(likelihood.profile_interval(fit, index)))
    }

    /// Returns the free parameters with their starts and bounds.
    fn parameters(&self) -> Vec<Parameter> {
        let parameter = |free: &NoiseParameter| {
            let value = free.get(&self.start.noise, &self.start.motion);
            Parameter { name: free.name(), start: value, lower: value * 1e-3, upper: value * 1e3 }
        };
        self.free.iter().map(parameter).collect()
    }

    fn family<const B: usize>(&self) -> Result<SensorFamily<'_, B>, CalibrationError> {
        let law = self.law.to_model().ok_or_else(|| CalibrationError::Unsupported("number of branches".into()))?;
        Ok(SensorFamily { law, noise: self.start.noise, motion: self.start.motion, free: self.free })
    }
}

/// Largest number of searches across jumps, and of Newton steps in each; a dozen or two are usual without jumps.
const MOST_ROUNDS: usize = 3;
const MOST_STEPS: usize = 40;
/// Side of the simplex, in the logarithms, and its number of steps; a hundred cost as much as a few Newton steps.
const SIMPLEX: (f64, Ends) = (0.3, Ends { iterations: 200, least_gain: 0.0 });

/// Returns the parameters, starting from the best point that a simplex finds around `from`.
fn across_jumps<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    likelihood: &Likelihood<F, N, L>,
    from: &LikelihoodFit,
) -> Result<Vec<Parameter>, CalibrationError> {
    let inside = |ln: &[f64]| -> Vec<f64> {
        let bounded = |(ln, parameter): (&f64, &Parameter)| ln.exp().max(parameter.lower).min(parameter.upper);
        ln.iter().zip(likelihood.parameters).map(bounded).collect()
    };
    let cost = |ln: &[f64]| likelihood.log_likelihood(&inside(ln)).map_or(f64::INFINITY, |found| -found.value);
    let from: Vec<f64> = from.parameters.iter().map(|parameter| parameter.value.ln()).collect();
    let values = inside(&nelder_mead(cost, &from, SIMPLEX.0, SIMPLEX.1));
    Ok(likelihood.parameters.iter().zip(values).map(|(parameter, start)| Parameter { start, ..*parameter }).collect())
}

/// Maximises a likelihood that may jump. A jump occurs where the mean of a filter crosses a limit of the law's range, at which the slope of
/// the gains ends; Newton's method may stop at its edge. A simplex continues from there, and Newton's method from the end of the simplex.
fn maximum<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    likelihood: &Likelihood<F, N, L>,
) -> Result<LikelihoodFit, CalibrationError> {
    let mut best = likelihood.fit_within(MOST_STEPS)?;
    for _ in 0..MOST_ROUNDS {
        if best.converged {
            break;
        }
        let start = across_jumps(likelihood, &best)?;
        let LikelihoodFit { iterations, .. } = best;
        let next = Likelihood { parameters: &start, ..*likelihood }.fit_within(MOST_STEPS)?;
        let risen = next.log_likelihood.value > best.log_likelihood.value;
        if risen {
            best = next.clone();
        }
        best.iterations = iterations + next.iterations;
        if !risen {
            break;
        }
    }
    Ok(best)
}
