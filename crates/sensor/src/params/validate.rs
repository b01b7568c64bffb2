//! The range of every number in a sensor's parameters, in one place.
//!
//! A damaged or badly edited file is rejected with the name of the number; it never becomes a filter with wrong
//! estimates.

mod correction;
pub mod table;

use ohmstrain_model::{Gauge, StrainRange};
pub use table::FieldError;
use table::{
    AMOUNT, ANY_NUMBER, Allowed, FACTOR, GAIN, LARGEST_CHANGE, NON_NEGATIVE, POSITIVE, RATE, SHARE, SIGNED, SPREAD,
    Table, ZERO_OR_POSITIVE, check, short,
};

use crate::params::estimator::{EstimatorParams, MotionParams, NoiseParams, PhaseParams};
use crate::params::law::LawParams;
use crate::params::static_cubic::StaticCubic;
use crate::params::summary::{Summary, TestedSummary};
use crate::params::temperature::TemperatureParams;
use crate::params::unstated::Unstated;
use crate::params::{JointParams, Quantity, RecordingInfo, Resolution, SensorParams, Sessions, Uncertainty, Validity};

/// Shortest range of strains, relative to its larger end.
const SHORTEST_RANGE: f64 = 1e-9;
/// Largest ratio between R₀ and the calibration's largest or smallest reading.
const REST_BEYOND: f64 = 100.0;
/// Largest distance of the mean strain beyond the limits, in spans.
const MEAN_BEYOND: f64 = 10.0;
/// Temperatures, °C, above absolute zero.
const CELSIUS: Allowed = Allowed { least: -273.15, most: 1e4 };
/// Relative changes per kelvin.
const PER_K: Allowed = Allowed { least: -1.0, most: 1.0 };
/// Number of intervals of the law's range at whose ends the gauge is checked.
const GAUGE_POINTS: u32 = 64;

impl SensorParams {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        let root = Table::root();
        root.number("rest_reading", self.rest_reading, POSITIVE)?;
        root.some("measured_rest", self.measured_rest, POSITIVE)?;
        self.summary.as_ref().map_or(Ok(()), |summary| summary.validate(&root.table("summary")))?;
        self.tested.map_or(Ok(()), |tested| tested.validate(&root.table("tested")))?;
        root.range("limits", self.limits)?;
        self.validity.validate(&root.table("validity"))?;
        self.check_rest(&root)?;
        self.sessions.map_or(Ok(()), |sessions| sessions.validate(&root.table("sessions")))?;
        self.unstated.validate(&root.table("unstated"))?;
        self.temperature.map_or(Ok(()), |temperature| temperature.validate(&root.table("temperature")))?;
        self.static_cubic.validate(&root.table("static_cubic"))?;
        self.joint.as_ref().map_or(Ok(()), |joint| joint.validate(&root.table("joint")))?;
        if self.joint.is_some() && self.quantity == Quantity::AngleDeg {
            return Err(root.wrong("quantity", "`strain` beside `[joint]`", Quantity::AngleDeg.name()));
        }
        self.law.validate(&root.table("law"))?;
        for (kind, estimator) in &self.estimators {
            estimator.validate(&root.table("estimators").table(kind.name()), self.limits)?;
        }
        for (index, recording) in self.recordings.iter().enumerate() {
            recording.validate(&root.entry("recordings", index))?;
        }
        self.uncertainty.as_ref().map_or(Ok(()), |uncertainty| uncertainty.validate(&root.table("uncertainty")))?;
        self.correction.as_ref().map_or(Ok(()), |correction| correction.validate(&root.table("correction")))
    }

    /// Rejects an R₀ in another unit than the readings, or with a digit too many.
    fn check_rest(&self, root: &Table) -> Result<(), FieldError> {
        let Validity { reading_lower, reading_upper, .. } = self.validity;
        let (least, most) = (reading_lower / REST_BEYOND, reading_upper * REST_BEYOND);
        let named = [("rest_reading", Some(self.rest_reading)), ("measured_rest", self.measured_rest)];
        let given = named.into_iter().filter_map(|(name, reading)| Some((name, reading?)));
        match given.into_iter().find(|(_, reading)| !(least..=most).contains(reading)) {
            None => Ok(()),
            Some((name, reading)) => {
                let expected = format!("{} to {}, near the readings of `validity`", short(least), short(most));
                Err(root.wrong(name, expected, short(reading)))
            }
        }
    }
}

/// Checks that two ends are in order, the upper one larger by more than rounding.
fn ends(table: &Table, names: [&str; 2], lower: f64, upper: f64, allowed: Allowed) -> Result<(), FieldError> {
    table.number(names[0], lower, allowed)?;
    table.number(names[1], upper, allowed)?;
    if upper - lower > SHORTEST_RANGE * lower.abs().max(upper.abs()) {
        return Ok(());
    }
    Err(table.wrong(names[1], format!("more than `{}`, {}", names[0], short(lower)), short(upper)))
}

impl Summary {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("left_out_percent_fs", self.left_out_percent_fs, NON_NEGATIVE)?;
        table.some("smoothed_percent_fs", self.smoothed_percent_fs, NON_NEGATIVE)?;
        check!(
            table, self;
            static_cubic_percent_fs: NON_NEGATIVE, coverage_95_percent: NON_NEGATIVE,
            width_95_percent_fs: NON_NEGATIVE,
        )
    }
}

impl TestedSummary {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(
            table, self;
            filter_percent_fs: NON_NEGATIVE, static_cubic_percent_fs: NON_NEGATIVE,
            coverage_95_percent: NON_NEGATIVE,
        )
    }
}

impl Sessions {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; rest_sd: POSITIVE, start_sd: POSITIVE)
    }
}

impl Unstated {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; filter_sd: AMOUNT, smoother_sd: AMOUNT)
    }
}

impl TemperatureParams {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        table.number("reference_c", self.reference_c, CELSIUS)?;
        ends(table, ["lower_c", "upper_c"], self.lower_c, self.upper_c, CELSIUS)?;
        check!(table, self; rest_per_k: PER_K, rest_per_k_sd: AMOUNT, gain_per_k: PER_K, gain_per_k_sd: AMOUNT)
    }
}

impl Table {
    /// Checks a range of strains.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn range(&self, name: &str, range: StrainRange<f64>) -> Result<(), FieldError> {
        ends(&self.table(name), ["lower", "upper"], range.lower, range.upper, SIGNED)
    }
}

impl Validity {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn validate(&self, table: &Table) -> Result<(), FieldError> {
        ends(table, ["lower", "upper"], self.lower, self.upper, SIGNED)?;
        ends(table, ["reading_lower", "reading_upper"], self.reading_lower, self.reading_upper, POSITIVE)?;
        check!(
            table, self;
            fastest_rate_per_s: ZERO_OR_POSITIVE, duration_s: ZERO_OR_POSITIVE, longest_repeat_s: ZERO_OR_POSITIVE,
        )?;
        table.some("longest_unturned_s", self.longest_unturned_s, POSITIVE)?;
        self.resolution.map_or(Ok(()), |resolution| resolution.validate(&table.table("resolution")))
    }
}

impl Resolution {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; step: ZERO_OR_POSITIVE, noise_sd: ZERO_OR_POSITIVE)
    }
}

impl StaticCubic {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.some("error_sd", self.error_sd, AMOUNT)?;
        check!(table, self; reading_centre: POSITIVE, reading_scale: POSITIVE)?;
        table.numbers("coefficients", &self.coefficients, SIGNED)?;
        table.range("range", self.range)
    }
}

impl JointParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("prestrain", self.prestrain, SIGNED)?;
        let arm = self.moment_arm_mm;
        if !(POSITIVE.least..=POSITIVE.most).contains(&arm.abs()) {
            return Err(table.wrong("moment_arm_mm", "a length, or a negative one, but not zero", short(arm)));
        }
        table.number("gauge_length_mm", self.gauge_length_mm, POSITIVE)
    }
}

impl LawParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; extend_viscosity_s: SIGNED, retract_viscosity_s: SIGNED)?;
        table.range("range", self.range)?;
        check_gauge(&table.table("gauge"), &self.gauge, self.range)?;
        for (index, branch) in self.branches.iter().enumerate() {
            let table = table.entry("branches", index);
            check!(
                table, branch;
                tau_s: POSITIVE, extend_gain: GAIN, retract_gain: GAIN, extend_gain_slope: GAIN,
                retract_gain_slope: GAIN,
            )?;
        }
        Ok(())
    }
}

/// Checks every number of a gauge by itself, and then the gauge over the strains of the law.
fn check_gauge(table: &Table, gauge: &Gauge<f64>, range: StrainRange<f64>) -> Result<(), FieldError> {
    match gauge {
        Gauge::Polynomial { coefficients } => table.numbers("coefficients", coefficients, SIGNED)?,
        Gauge::DecayingExponential { slope, decay_strain } => {
            table.number("slope", *slope, SIGNED)?;
            table.number("decay_strain", *decay_strain, SIGNED)?;
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            table.number("gap", *gap, SIGNED)?;
            table.number("barrier", *barrier, SIGNED)?;
            table.number("path_loss", *path_loss, SIGNED)?;
        }
    }
    for point in 0..=GAUGE_POINTS {
        let strain = range.lower + range.span() * f64::from(point) / f64::from(GAUGE_POINTS);
        let (value, slope) = gauge.value_and_slope(strain);
        let steepest = LARGEST_CHANGE / range.span();
        if !(value.abs() <= LARGEST_CHANGE && slope.abs() <= steepest) {
            let expected = format!("changes of resistance up to {LARGEST_CHANGE:e} R0 within `law.range`");
            let found = format!("{} with slope {} at {}", short(value), short(slope), short(strain));
            return Err(table.wrong_itself(expected, found));
        }
    }
    Ok(())
}

impl EstimatorParams {
    fn validate(&self, table: &Table, limits: StrainRange<f64>) -> Result<(), FieldError> {
        check!(table, self; score: ANY_NUMBER, strain_sd_scale: FACTOR)?;
        table.some("smoothed_sd_scale", self.smoothed_sd_scale, FACTOR)?;
        self.motion.validate(&table.table("motion"), limits)?;
        self.noise.validate(&table.table("noise"))?;
        self.phases.map_or(Ok(()), |phases| phases.validate(&table.table("phases")))?;
        let Some(settling) = self.settling else { return Ok(()) };
        let table = table.table("settling");
        check!(table, settling; horizon_s: POSITIVE, share: SHARE, share_sd: AMOUNT, sd: AMOUNT)
    }
}

impl MotionParams {
    fn validate(&self, table: &Table, limits: StrainRange<f64>) -> Result<(), FieldError> {
        let Self { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = *self;
        table.number("rate_sd_per_s", rate_sd_per_s, RATE)?;
        let beyond = MEAN_BEYOND * limits.span();
        let (least, most) = (limits.lower - beyond, limits.upper + beyond);
        if !(least..=most).contains(&strain_mean) {
            let expected = format!("{} to {}, near the `limits`", short(least), short(most));
            return Err(table.wrong("strain_mean", expected, short(strain_mean)));
        }
        table.number("strain_sd", strain_sd, SPREAD)?;
        table.number("rate_time_s", rate_time_s, POSITIVE)
    }
}

impl NoiseParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(
            table, self;
            reading_sd: AMOUNT, reading_time_s: AMOUNT, branch_sd: AMOUNT, baseline_sd: AMOUNT,
            baseline_time_s: POSITIVE,
        )
    }
}

impl PhaseParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(
            table, self;
            hold_time_s: POSITIVE, move_time_s: POSITIVE, reversal: SHARE, speed_per_s: AMOUNT,
            tempering: SHARE,
        )
    }
}

impl RecordingInfo {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; first_s: ANY_NUMBER, last_s: ANY_NUMBER, rest_reading: POSITIVE)
    }
}

impl Uncertainty {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        let size = self.names.len();
        table.length("values", size, self.values.len())?;
        table.numbers("values", &self.values, ANY_NUMBER)?;
        table.length("standard_errors", size, self.standard_errors.len())?;
        table.numbers("standard_errors", &self.standard_errors, NON_NEGATIVE)?;
        table.length("covariance", size, self.covariance.len())?;
        for (index, row) in self.covariance.iter().enumerate() {
            let name = format!("covariance[{index}]");
            table.length(&name, size, row.len())?;
            table.numbers(&name, row, ANY_NUMBER)?;
        }
        Ok(())
    }
}
