use std::io::Write;

use ohmstrain_calib::likelihood::{Bound, NoiseFit, NoiseParameter, NoiseStart, ProfileInterval, ReadingsLikelihood};

use crate::error::CliError;
use crate::output;

/// Results of `refine`.
pub struct Refinement {
    /// Noise and motion of the sensor file.
    pub start: NoiseStart,
    /// The parameters that were optimised.
    pub free: Vec<NoiseParameter>,
    /// The log-likelihood with the sensor file's noise.
    pub before: ReadingsLikelihood<f64>,
    /// The maximum.
    pub found: NoiseFit,
    /// An interval for each parameter in `free`.
    pub profiles: Vec<ProfileInterval>,
}

/// Prints what was found.
pub fn write(out: &mut dyn Write, refinement: &Refinement) -> Result<(), CliError> {
    let Refinement { start, free, before, found, profiles } = refinement;
    let mut table =
        output::wrapped_table(["parameter", "before", "after", "s.e. of ln", "95 % profile interval", "on bound"]);
    for ((parameter, fitted), profile) in free.iter().zip(&found.fit.parameters).zip(profiles) {
        table.add_row([
            fitted.name.to_string(),
            number(parameter.get(&start.noise, &start.motion)),
            number(fitted.value),
            // Away from a maximum the curvature is no information on the parameter.
            fitted
                .ln_standard_error
                .filter(|_| found.fit.converged)
                .map_or_else(|| "-".into(), |error| format!("{error:.3}")),
            interval(profile),
            fitted.bound.map_or("", Bound::name).to_string(),
        ]);
    }
    writeln!(out, "{table}")?;
    let (after, fitted) = (found.fit.log_likelihood, free.len());
    writeln!(
        out,
        "log-likelihood of {} readings: {:.3} before, {:.3} after",
        after.readings, before.value, after.value
    )?;
    let aic = |parameters: usize, value: f64| 2.0 * parameters as f64 - 2.0 * value;
    let (aic_before, aic_after) = (aic(0, before.value), aic(fitted, after.value));
    writeln!(
        out,
        "AIC: {aic_before:.2} before, with nothing fitted to these readings; {aic_after:.2} after, {fitted} fitted"
    )?;
    let (norm, steps) = (found.fit.gradient_norm, found.fit.iterations);
    writeln!(out, "gradient norm {norm:.1e} after {steps} Newton steps")?;
    let held: Vec<&str> =
        NoiseParameter::ALL.iter().filter(|each| !free.contains(each)).map(|each| each.name()).collect();
    if !held.is_empty() {
        writeln!(out, "held: {}", held.join(", "))?;
    }
    Ok(())
}

fn number(value: f64) -> String {
    format!("{value:.4e}")
}

/// Formats an interval; `-` if the likelihood does not fall far enough before a bound, or no end was found.
fn interval(profile: &ProfileInterval) -> String {
    let end = |end: Option<f64>| end.map_or_else(|| "-".into(), number);
    match (profile.lower, profile.upper) {
        (None, None) => "-".into(),
        (lower, upper) => format!("{} to {}", end(lower), end(upper)),
    }
}
