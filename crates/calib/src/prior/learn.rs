use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector};
use ohmstrain_model::StrainRange;

use super::law::LawPrior;
use super::noise::EstimatorPrior;
use super::population::Population;
use super::probe::Probe;
use super::rows::CorrectionPrior;
use super::{FEWEST_SENSORS, PRIOR_FORMAT, Prior, median};
use crate::CalibrationError;
use ohmstrain_sensor::{CorrectionParams, EstimatorKind, EstimatorParams, LawParams, SensorParams, Validity};

/// Least assumed spread of a weight between sensors, relative to the mean; and a variance, relative to R₀, that keeps a covariance regular.
const LEAST_SPREAD: f64 = 0.01;
const LEAST_VARIANCE: f64 = 1e-8;

impl Prior {
    /// Learns from calibrated sensors of one make. The same sensors in the same order give the same prior.
    ///
    /// Laws of any structure are expressed in the commonest number of branches with its median time constants, by their readings for one
    /// motion. The standard errors of the sensors' parameters are subtracted from their spread. They belong to the fit without a ridge and
    /// are thus larger than the errors of the law itself, so at least a tenth of the spread is kept.
    ///
    /// # Errors
    /// If there are fewer than three sensors, if they estimate different quantities, or if their laws cannot be compared.
    pub fn learn(sensors: &[SensorParams], made_by: &str) -> Result<Self, CalibrationError> {
        let Some(first) = sensors.first().filter(|_| sensors.len() >= FEWEST_SENSORS) else {
            let message = format!("{} sensors; a fleet has at least {FEWEST_SENSORS}", sensors.len());
            return Err(CalibrationError::Unsupported(message));
        };
        if sensors.iter().any(|sensor| sensor.quantity != first.quantity) {
            return Err(CalibrationError::Unsupported("sensors of different quantities".into()));
        }
        let validity = of_median(sensors);
        let mut kinds: BTreeMap<EstimatorKind, Vec<&EstimatorParams>> = BTreeMap::new();
        for (kind, params) in sensors.iter().flat_map(|sensor| &sensor.estimators) {
            kinds.entry(*kind).or_default().push(params);
        }
        kinds.retain(|_, params| params.len() >= FEWEST_SENSORS);
        let estimators = kinds.iter().filter_map(|(kind, params)| Some((*kind, EstimatorPrior::learn(params)?)));
        Ok(Self {
            format: PRIOR_FORMAT,
            made_by: made_by.into(),
            sensors: sensors.len(),
            quantity: first.quantity,
            law: law(sensors, &validity)?,
            estimators: estimators.collect(),
            correction: correction(sensors),
            validity,
        })
    }
}

fn law(sensors: &[SensorParams], validity: &Validity) -> Result<LawPrior, CalibrationError> {
    let range = StrainRange { lower: validity.lower, upper: validity.upper };
    let laws: Vec<&LawParams> = sensors.iter().map(|sensor| &sensor.law).collect();
    let tau_s = time_constants(&laws);
    let probe = Probe::new(range, validity.fastest_rate_per_s, &tau_s)?;
    let weights: Vec<DVector<f64>> = laws.iter().map(|law| probe.weights(law)).collect();
    let errors = sensors.iter().filter_map(|sensor| Some(probe.errors(&sensor.law, sensor.uncertainty.as_ref()?)));
    let mut population = Population::new(&weights, usual(errors.collect(), &weights).as_ref());
    for (i, mean) in population.mean.iter().enumerate() {
        population.covariance[(i, i)] += (LEAST_SPREAD * mean).powi(2).max(LEAST_VARIANCE);
    }
    let density = |sensor: &SensorParams| error_density_s(sensor).map(f64::ln);
    let densities: Vec<f64> = sensors.iter().filter_map(density).collect();
    Ok(LawPrior {
        range,
        tau_s,
        error_density_s: median(densities).exp(),
        mean: population.mean.iter().copied().collect(),
        covariance: population.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
    })
}

/// Returns the median time constants, s, of the laws with the commonest number of branches; of equally common ones, the smaller.
fn time_constants(laws: &[&LawParams]) -> Vec<f64> {
    let count = |branches: usize| laws.iter().filter(|law| law.branches.len() == branches).count();
    let numbers = laws.iter().map(|law| law.branches.len());
    let branches = numbers.max_by_key(|branches| (count(*branches), usize::MAX - branches)).unwrap_or(0);
    let of_size = || laws.iter().filter(|law| law.branches.len() == branches);
    (0..branches).map(|i| median(of_size().map(|law| law.branches[i].tau_s))).collect()
}

/// Returns the errors of the sensor with the median errors, relative to the spread of all: a few uninformative recordings should not
/// represent the others.
fn usual(mut errors: Vec<DMatrix<f64>>, members: &[DVector<f64>]) -> Option<DMatrix<f64>> {
    let rows: Vec<_> = members.iter().map(DVector::transpose).collect();
    let spread = DMatrix::from_rows(&rows).row_variance();
    let size = |errors: &DMatrix<f64>| {
        let share = |(i, spread): (usize, &f64)| errors[(i, i)] / spread.max(f64::MIN_POSITIVE);
        spread.iter().enumerate().map(share).sum::<f64>()
    };
    errors.retain(|errors| errors.iter().all(|x| x.is_finite()));
    errors.sort_by(|a, b| size(a).total_cmp(&size(b)));
    (!errors.is_empty()).then(|| errors.swap_remove(errors.len() / 2))
}

/// Returns the spectral density of the law's error in the default filter, s: variance times twice the correlation time, summed over the
/// baseline and the branches' noise.
fn error_density_s(sensor: &SensorParams) -> Option<f64> {
    let noise = sensor.estimators.get(&sensor.filter_of(sensor.default_estimator))?.noise;
    let branches: f64 = sensor.law.branches.iter().map(|branch| branch.tau_s).sum();
    let density = 2.0 * (noise.baseline_sd.powi(2) * noise.baseline_time_s + noise.branch_sd.powi(2) * branches);
    (density > 0.0).then_some(density)
}

/// Learns from the rows of the sensors that correct the commonest filter.
fn correction(sensors: &[SensorParams]) -> Option<CorrectionPrior> {
    let corrections: Vec<&CorrectionParams> = sensors.iter().filter_map(|sensor| sensor.correction.as_ref()).collect();
    let count = |kind: EstimatorKind| corrections.iter().filter(|one| one.corrects == kind).count();
    let commonest = EstimatorKind::ALL.into_iter().max_by_key(|kind| count(*kind))?;
    let of_kind: Vec<_> = corrections.iter().copied().filter(|one| one.corrects == commonest).collect();
    (of_kind.len() >= FEWEST_SENSORS).then(|| CorrectionPrior::learn(&of_kind)).flatten()
}

/// Returns the median of the sensors' calibrated ranges, with readings over R₀.
fn of_median(sensors: &[SensorParams]) -> Validity {
    let of = |number: fn(&SensorParams) -> f64| median(sensors.iter().map(number));
    Validity {
        lower: of(|sensor| sensor.law.range.lower),
        upper: of(|sensor| sensor.law.range.upper),
        reading_lower: of(|sensor| sensor.validity.reading_lower / sensor.rest_reading),
        reading_upper: of(|sensor| sensor.validity.reading_upper / sensor.rest_reading),
        fastest_rate_per_s: of(|sensor| sensor.validity.fastest_rate_per_s),
        duration_s: of(|sensor| sensor.validity.duration_s),
        drifts: sensors.iter().any(|sensor| sensor.validity.drifts),
        longest_repeat_s: of(|sensor| sensor.validity.longest_repeat_s),
        longest_unturned_s: crate::order::median(
            sensors.iter().filter_map(|sensor| sensor.validity.longest_unturned_s),
        ),
        resolution: None,
    }
}

/// True if a covariance is positive definite.
pub(crate) fn is_covariance(rows: &[Vec<f64>]) -> bool {
    let size = rows.len();
    rows.iter().all(|row| row.len() == size)
        && (0..size).all(|i| (0..i).all(|j| rows[i][j] == rows[j][i]))
        && Cholesky::new(DMatrix::from_fn(size, size, |i, j| rows[i][j])).is_some()
}
