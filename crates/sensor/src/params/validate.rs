//! The range of every number in a sensor's parameters, in one place.
//!
//! A damaged or badly edited file is rejected with the name of the number; it never becomes a filter with wrong
//! estimates.

mod correction;
pub mod table;

pub use table::FieldError;
use table::{
    AMOUNT, ANY_NUMBER, Allowed, FACTOR, GAIN, LARGEST_CHANGE, NON_NEGATIVE, POSITIVE, RATE, SHARE, SIGNED, SPREAD,
    Table, short,
};

use crate::params::estimator::{EstimatorParams, MotionParams, NoiseParams, PhaseParams, SettlingParams};
use crate::params::law::{GaugeParams, LawParams};
use crate::params::range::RangeParams;
use crate::params::static_cubic::StaticCubic;
use crate::params::summary::{Summary, TestedSummary};
use crate::params::temperature::TemperatureParams;
use crate::params::unstated::Unstated;
use crate::params::{JointParams, RecordingInfo, Resolution, SensorParams, Sessions, Uncertainty, Validity};

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
        self.measured_rest.map_or(Ok(()), |measured| root.number("measured_rest", measured, POSITIVE))?;
        if let Some(summary) = &self.summary {
            summary.validate(&root.table("summary"))?;
        }
        self.tested.map_or(Ok(()), |tested| tested.validate(&root.table("tested")))?;
        self.limits.validate(&root.table("limits"))?;
        self.validity.validate(&root.table("validity"))?;
        self.check_rest(&root)?;
        self.sessions.map_or(Ok(()), |sessions| sessions.validate(&root.table("sessions")))?;
        self.unstated.validate(&root.table("unstated"))?;
        self.temperature.map_or(Ok(()), |temperature| temperature.validate(&root.table("temperature")))?;
        self.static_cubic.validate(&root.table("static_cubic"))?;
        if let Some(joint) = &self.joint {
            joint.validate(&root.table("joint"))?;
        }
        self.law.validate(&root.table("law"))?;
        for (kind, estimator) in &self.estimators {
            estimator.validate(&root.table("estimators").table(kind.name()), self.limits)?;
        }
        for (index, recording) in self.recordings.iter().enumerate() {
            recording.validate(&root.entry("recordings", index))?;
        }
        if let Some(uncertainty) = &self.uncertainty {
            uncertainty.validate(&root.table("uncertainty"))?;
        }
        self.correction.as_ref().map_or(Ok(()), |correction| correction.validate(&root.table("correction")))
    }
}

impl SensorParams {
    /// Rejects an R₀ in another unit than the readings, or with a digit too many.
    fn check_rest(&self, root: &Table) -> Result<(), FieldError> {
        let Validity { reading_lower, reading_upper, .. } = self.validity;
        let (least, most) = (reading_lower / REST_BEYOND, reading_upper * REST_BEYOND);
        if (least..=most).contains(&self.rest_reading) {
            return Ok(());
        }
        let expected = format!("{} to {}, near the readings of `validity`", short(least), short(most));
        Err(root.wrong("rest_reading", expected, short(self.rest_reading)))
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
        self.smoothed_percent_fs.map_or(Ok(()), |error| table.number("smoothed_percent_fs", error, NON_NEGATIVE))?;
        table.number("static_cubic_percent_fs", self.static_cubic_percent_fs, NON_NEGATIVE)?;
        table.number("coverage_95_percent", self.coverage_95_percent, NON_NEGATIVE)?;
        table.number("width_95_percent_fs", self.width_95_percent_fs, NON_NEGATIVE)
    }
}

impl TestedSummary {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("filter_percent_fs", self.filter_percent_fs, NON_NEGATIVE)?;
        table.number("static_cubic_percent_fs", self.static_cubic_percent_fs, NON_NEGATIVE)?;
        table.number("coverage_95_percent", self.coverage_95_percent, NON_NEGATIVE)
    }
}

impl Sessions {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        table.number("rest_sd", self.rest_sd, POSITIVE)?;
        table.number("start_sd", self.start_sd, POSITIVE)
    }
}

impl Unstated {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        table.number("filter_sd", self.filter_sd, AMOUNT)?;
        table.number("smoother_sd", self.smoother_sd, AMOUNT)
    }
}

impl TemperatureParams {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        table.number("reference_c", self.reference_c, CELSIUS)?;
        ends(table, ["lower_c", "upper_c"], self.lower_c, self.upper_c, CELSIUS)?;
        table.number("rest_per_k", self.rest_per_k, PER_K)?;
        table.number("rest_per_k_sd", self.rest_per_k_sd, AMOUNT)?;
        table.number("gain_per_k", self.gain_per_k, PER_K)?;
        table.number("gain_per_k_sd", self.gain_per_k_sd, AMOUNT)
    }
}

impl RangeParams {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn validate(self, table: &Table) -> Result<(), FieldError> {
        ends(table, ["lower", "upper"], self.lower, self.upper, SIGNED)
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
        table.number("fastest_rate_per_s", self.fastest_rate_per_s, NON_NEGATIVE)?;
        table.number("duration_s", self.duration_s, NON_NEGATIVE)?;
        table.number("longest_repeat_s", self.longest_repeat_s, NON_NEGATIVE)?;
        self.longest_unturned_s.map_or(Ok(()), |longest_s| table.number("longest_unturned_s", longest_s, POSITIVE))?;
        self.resolution.map_or(Ok(()), |resolution| resolution.validate(&table.table("resolution")))
    }
}

impl Resolution {
    fn validate(self, table: &Table) -> Result<(), FieldError> {
        table.number("step", self.step, NON_NEGATIVE)?;
        table.number("noise_sd", self.noise_sd, NON_NEGATIVE)
    }
}

impl StaticCubic {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("reading_centre", self.reading_centre, POSITIVE)?;
        table.number("reading_scale", self.reading_scale, POSITIVE)?;
        table.numbers("coefficients", &self.coefficients, SIGNED)?;
        self.range.validate(&table.table("range"))
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
        table.number("extend_viscosity_s", self.extend_viscosity_s, SIGNED)?;
        table.number("retract_viscosity_s", self.retract_viscosity_s, SIGNED)?;
        self.range.validate(&table.table("range"))?;
        self.gauge.validate(&table.table("gauge"), self.range)?;
        for (index, branch) in self.branches.iter().enumerate() {
            let table = table.entry("branches", index);
            table.number("tau_s", branch.tau_s, POSITIVE)?;
            table.number("extend_gain", branch.extend_gain, GAIN)?;
            table.number("retract_gain", branch.retract_gain, GAIN)?;
            table.number("extend_gain_slope", branch.extend_gain_slope, GAIN)?;
            table.number("retract_gain_slope", branch.retract_gain_slope, GAIN)?;
        }
        Ok(())
    }
}

impl GaugeParams {
    /// Checks every number by itself, and then the gauge over the strains of the law.
    fn validate(&self, table: &Table, range: RangeParams) -> Result<(), FieldError> {
        match self {
            Self::Polynomial { coefficients } => table.numbers("coefficients", coefficients, SIGNED)?,
            Self::DecayingExponential { slope, decay_strain } => {
                table.number("slope", *slope, SIGNED)?;
                table.number("decay_strain", *decay_strain, SIGNED)?;
            }
            Self::Tunnelling { gap, barrier, path_loss } => {
                table.number("gap", *gap, SIGNED)?;
                table.number("barrier", *barrier, SIGNED)?;
                table.number("path_loss", *path_loss, SIGNED)?;
            }
        }
        let gauge = self.to_model();
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
}

impl EstimatorParams {
    fn validate(&self, table: &Table, limits: RangeParams) -> Result<(), FieldError> {
        table.number("score", self.score, ANY_NUMBER)?;
        table.number("strain_sd_scale", self.strain_sd_scale, FACTOR)?;
        if let Some(scale) = self.smoothed_sd_scale {
            table.number("smoothed_sd_scale", scale, FACTOR)?;
        }
        self.motion.validate(&table.table("motion"), limits)?;
        self.noise.validate(&table.table("noise"))?;
        self.phases.map_or(Ok(()), |phases| phases.validate(&table.table("phases")))?;
        self.settling.map_or(Ok(()), |settling| settling.validate(&table.table("settling")))
    }
}

impl SettlingParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("horizon_s", self.horizon_s, POSITIVE)?;
        table.number("share", self.share, SHARE)?;
        table.number("share_sd", self.share_sd, AMOUNT)?;
        table.number("sd", self.sd, AMOUNT)
    }
}

impl MotionParams {
    fn validate(&self, table: &Table, limits: RangeParams) -> Result<(), FieldError> {
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
        table.number("reading_sd", self.reading_sd, AMOUNT)?;
        table.number("reading_time_s", self.reading_time_s, AMOUNT)?;
        table.number("branch_sd", self.branch_sd, AMOUNT)?;
        table.number("baseline_sd", self.baseline_sd, AMOUNT)?;
        table.number("baseline_time_s", self.baseline_time_s, POSITIVE)
    }
}

impl PhaseParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("hold_time_s", self.hold_time_s, POSITIVE)?;
        table.number("move_time_s", self.move_time_s, POSITIVE)?;
        table.number("reversal", self.reversal, SHARE)?;
        table.number("speed_per_s", self.speed_per_s, AMOUNT)?;
        table.number("tempering", self.tempering, SHARE)
    }
}

impl RecordingInfo {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("first_s", self.first_s, ANY_NUMBER)?;
        table.number("last_s", self.last_s, ANY_NUMBER)?;
        table.number("rest_reading", self.rest_reading, POSITIVE)
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
