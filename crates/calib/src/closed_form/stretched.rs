use super::datum::Moment;
use super::law::{Parameter, SeparableLaw, Unit};
use super::search::{Extent, Search};

/// Stretched exponential (Kohlrausch-Williams-Watts): `R∞ + r exp(-(t/τ)^β)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StretchedExponential;

impl SeparableLaw for StretchedExponential {
    fn linear(&self) -> Vec<Parameter> {
        ["r_inf", "r"].map(|name| Parameter::new(name, Unit::Reading)).to_vec()
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        vec![Parameter::new("tau_s", Unit::Second), Parameter::new("beta", Unit::One)]
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        let mut searches = extent.time_constants(1);
        // Below 0.05 the law is a logarithm of time, above 2 it falls faster than a Gaussian: neither is a relaxation.
        searches.push(Search::between(0.05, 2.0, &[0.3, 0.5, 0.8, 1.0]));
        searches
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let (tau_s, beta) = (theta[0], theta[1]);
        values[0] = 1.0;
        if at.elapsed_s <= 0.0 {
            values[1] = 1.0;
            return;
        }
        let ratio = at.elapsed_s / tau_s;
        let power = ratio.powf(beta);
        let value = (-power).exp();
        values[1] = value;
        slopes[2] = value * power * beta / tau_s;
        slopes[3] = -value * power * ratio.ln();
    }
}
