use std::str::FromStr;

use nalgebra::DVector;
use ohmstrain_model::{Branch, Gauge};

use crate::CalibrationError;
use crate::law::design::{BRANCH_COLUMNS, StrainScale};
use crate::law::regression::{Design, LawRegression};
use ohmstrain_sensor::LawParams;

/// Families of gauge curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GaugeFamily {
    /// Cubic polynomial.
    Polynomial,
    /// `G ε exp(-ε/ε₀)`.
    DecayingExponential,
    /// `(1 + C ε) exp(A ε + W ε²) - 1`.
    Tunnelling,
}

impl GaugeFamily {
    /// All families.
    pub const ALL: [Self; 3] = [Self::Polynomial, Self::DecayingExponential, Self::Tunnelling];

    /// Returns its name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Polynomial => "polynomial",
            Self::DecayingExponential => "decaying-exponential",
            Self::Tunnelling => "tunnelling",
        }
    }
}

/// Parses a name; the error also lists `auto`, which callers take for no choice.
impl FromStr for GaugeFamily {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|family| family.name() == name);
        found.ok_or_else(|| "expected auto, polynomial, decaying-exponential or tunnelling".into())
    }
}

/// A law fitted to recordings with known strain.
#[derive(Clone, Debug)]
pub struct LawFit {
    /// The law.
    pub law: LawParams,
    /// R₀ of each recording.
    pub rest_readings: Vec<f64>,
    /// Reading over R₀, minus 1 and the law, row by row of each recording; NaN where the reading is missing.
    pub residuals: Vec<Vec<f64>>,
    /// Root mean squared error on held-out blocks, relative to R₀.
    pub cross_validated_error: f64,
    /// Ridge of the fit.
    pub ridge: f64,
}

/// Smallest credible R₀, relative to the median reading.
const LEAST_REST_SHARE: f64 = 0.05;

/// A structure with its time constants and gauge parameters.
#[derive(Clone, Debug)]
pub(crate) struct LawStructure {
    pub family: GaugeFamily,
    /// ln τ, then the gauge's own nonlinear parameters.
    pub nonlinear: Vec<f64>,
    pub taus: usize,
    pub ridge: f64,
}

impl LawStructure {
    /// Returns the structure of a fitted law.
    pub(crate) fn of_law(law: &LawParams, span: f64, ridge: f64) -> Self {
        let mut nonlinear: Vec<f64> = law.branches.iter().map(|branch| branch.tau_s.ln()).collect();
        let family = match law.gauge {
            Gauge::Polynomial { .. } => GaugeFamily::Polynomial,
            Gauge::DecayingExponential { decay_strain, .. } => {
                nonlinear.push((decay_strain / span).ln());
                GaugeFamily::DecayingExponential
            }
            Gauge::Tunnelling { gap, barrier, path_loss } => {
                nonlinear.extend([(1.0 + gap * span).ln(), barrier * span, path_loss * span * span]);
                GaugeFamily::Tunnelling
            }
        };
        Self { family, taus: law.branches.len(), nonlinear, ridge }
    }

    /// Builds the design: constant, one more constant per further recording, gauge, dash-pots, branches.
    pub(crate) fn design(&self, regression: &LawRegression) -> Design {
        let mut columns: Vec<DVector<f64>> =
            (0..regression.recordings.len()).map(|r| regression.own_constant(r)).collect();
        columns[0].fill(1.0);
        let free = columns.len();
        let (gauge, span) = (&self.nonlinear[self.taus..], regression.scale.span);
        let mut offset = DVector::zeros(columns[0].len());
        match self.family {
            GaugeFamily::Polynomial => columns.extend((1..=3).map(|power| {
                regression.column(|recording| recording.regressors.of_strain(|x| (x / span).powi(power)))
            })),
            GaugeFamily::DecayingExponential => {
                let decay = gauge[0].exp() * span;
                columns.push(regression.column(|r| r.regressors.of_strain(|x| x / span * (-x / decay).exp())));
            }
            GaugeFamily::Tunnelling => {
                let curve = tunnelling(gauge, span);
                offset = regression.column(|r| r.regressors.of_strain(|x| curve.value_and_slope(x).0));
            }
        }
        columns.extend(regression.columns(|recording| recording.regressors.viscosity()));
        for ln_tau in &self.nonlinear[..self.taus] {
            columns.extend(regression.columns::<BRANCH_COLUMNS>(|recording| recording.regressors.branch(ln_tau.exp())));
        }
        Design { columns, free, offset }
    }

    /// Fits the law without block `left_out` of every recording.
    pub(crate) fn fit(&self, regression: &LawRegression, left_out: Option<usize>) -> Result<LawFit, CalibrationError> {
        let design = self.design(regression);
        let solution = regression.solve(&design, self.ridge, left_out).ok_or(CalibrationError::Singular)?;
        for (recording, rest) in regression.recordings.iter().zip(&solution.rest_readings) {
            let share = rest / recording.median_reading();
            if share < LEAST_REST_SHARE {
                return Err(CalibrationError::RestResistance { value: share });
            }
        }
        let residual = regression.response(&solution.rest_readings) - design.fitted(&solution.weights);
        Ok(LawFit {
            law: self.law(regression, solution.weights.as_slice()),
            rest_readings: solution.rest_readings,
            residuals: regression.by_recording(&residual),
            cross_validated_error: solution.cross_validated.sqrt(),
            ridge: self.ridge,
        })
    }

    /// Returns the weights of a law of this structure in the design of one recording, constant included; the inverse of [`Self::law`].
    pub(crate) fn weights(&self, law: &LawParams, scale: StrainScale) -> DVector<f64> {
        let StrainScale { centre, span } = scale;
        let mut weights = vec![0.0];
        match law.gauge {
            Gauge::Polynomial { coefficients: [a, b, c] } => {
                weights.extend([a * span, b * span.powi(2), c * span.powi(3)]);
            }
            Gauge::DecayingExponential { slope, .. } => weights.push(slope * span),
            Gauge::Tunnelling { .. } => {}
        }
        weights.extend([law.extend_viscosity_s * span, law.retract_viscosity_s * span]);
        for branch in &law.branches {
            let gain = |gain: f64, slope: f64| (gain + slope * centre) * span;
            weights.extend([
                gain(branch.extend_gain, branch.extend_gain_slope),
                gain(branch.retract_gain, branch.retract_gain_slope),
                branch.extend_gain_slope * span.powi(2),
                branch.retract_gain_slope * span.powi(2),
            ]);
        }
        DVector::from_vec(weights)
    }

    pub(crate) fn sort_branches(&mut self) {
        self.nonlinear[..self.taus].sort_by(f64::total_cmp);
    }

    /// Converts the weights to a law in its own units.
    pub(crate) fn law(&self, regression: &LawRegression, weights: &[f64]) -> LawParams {
        let StrainScale { centre, span } = regression.scale;
        let mut rest = weights[regression.recordings.len()..].iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        let gauge = match self.family {
            GaugeFamily::Polynomial => {
                Gauge::Polynomial { coefficients: [next() / span, next() / span.powi(2), next() / span.powi(3)] }
            }
            GaugeFamily::DecayingExponential => Gauge::DecayingExponential {
                slope: next() / span,
                decay_strain: self.nonlinear[self.taus].exp() * span,
            },
            GaugeFamily::Tunnelling => tunnelling(&self.nonlinear[self.taus..], span),
        };
        let (extend_viscosity_s, retract_viscosity_s) = (next() / span, next() / span);
        let branches = self.nonlinear[..self.taus]
            .iter()
            .map(|ln_tau| {
                let [extend, retract, extend_slope, retract_slope] = [next(), next(), next(), next()];
                Branch {
                    tau_s: ln_tau.exp(),
                    extend_gain: (extend - extend_slope * centre / span) / span,
                    retract_gain: (retract - retract_slope * centre / span) / span,
                    extend_gain_slope: extend_slope / span.powi(2),
                    retract_gain_slope: retract_slope / span.powi(2),
                }
            })
            .collect();
        LawParams { extend_viscosity_s, retract_viscosity_s, range: regression.range, gauge, branches }
    }
}

/// Returns the tunnelling curve, given parameters of order one.
fn tunnelling(parameters: &[f64], span: f64) -> Gauge<f64> {
    Gauge::Tunnelling {
        gap: (parameters[0].exp() - 1.0) / span,
        barrier: parameters[1] / span,
        path_loss: parameters[2] / (span * span),
    }
}
