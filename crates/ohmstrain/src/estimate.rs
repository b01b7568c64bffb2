use ohmstrain_ekf::live::{FARTHEST_REST, KNOWN_BEYOND, SURPRISING_NIS};
use ohmstrain_ekf::{Gaussian, ReadingVerdict};
use ohmstrain_model::{Joint, StrainRange};
use ohmstrain_sensor::{Output, Quantity, SensorParams};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::column::Header;
use crate::{Error, Flag, Flags, Reading, Sensor};

/// Estimate at one row: a row of `estimates.csv`, one field per column. It serialises with the names of that file's header,
/// which contain the unit; an unknown value serialises as none.
///
/// For a sensor calibrated in degrees, the four fields of strain are in degrees and degrees per second.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let row = sensor.filter().build()?.step(0.0, 1600.0)?;
/// println!("{:.3} ± {:.3}, {:.0} % stretching", row.strain, row.strain_sd, 100.0 * row.p_extend.unwrap_or(f64::NAN));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Estimate {
    /// Time, s.
    pub time_s: f64,
    /// The reading as recorded, in the sensor's unit; `None` where it is missing.
    pub resistance: Option<f64>,
    /// Strain, moved into the sensor's limits.
    pub strain: f64,
    /// Its standard deviation.
    pub strain_sd: f64,
    /// Strain rate, 1/s.
    pub strain_rate: f64,
    /// Its standard deviation.
    pub strain_rate_sd: f64,
    /// Sum of the relaxing branches, relative to R₀.
    pub relaxation: f64,
    /// Its standard deviation.
    pub relaxation_sd: f64,
    /// Slow drift and error of the law, relative to R₀.
    pub baseline: f64,
    /// Predicted reading, in the sensor's unit, if the strain is held from now on for as long as the longest hold of the
    /// calibration (a minute, if it had none). It is the reading, or the sensor's expected one, minus the law's relaxation,
    /// scaled by the share of it that was observed in calibration.
    pub settled_resistance: f64,
    /// Its standard deviation.
    pub settled_resistance_sd: f64,
    /// Probability that the sensor is being stretched; `None` if the estimator has no phases.
    pub p_extend: Option<f64>,
    /// Probability that it is held.
    pub p_hold: Option<f64>,
    /// Probability that it is being released.
    pub p_retract: Option<f64>,
    /// Probability that the strain lies beyond the peak of the quasi-static curve.
    pub p_beyond_border: f64,
    /// Squared innovation of the reading over its variance; `None` without a reading.
    pub nis: Option<f64>,
    /// Flags.
    pub flags: Flags,
    /// Angle of the joint, degrees; `None` without a joint.
    pub angle_deg: Option<f64>,
    /// Its standard deviation.
    pub angle_sd: Option<f64>,
    header: Header,
}

/// A row with all values unknown: NaN and `None`. It serialises as a row of a sensor that reads ohms and estimates strain.
impl Default for Estimate {
    fn default() -> Self {
        let unknown = f64::NAN;
        Self {
            time_s: unknown,
            resistance: None,
            strain: unknown,
            strain_sd: unknown,
            strain_rate: unknown,
            strain_rate_sd: unknown,
            relaxation: unknown,
            relaxation_sd: unknown,
            baseline: unknown,
            settled_resistance: unknown,
            settled_resistance_sd: unknown,
            p_extend: None,
            p_hold: None,
            p_retract: None,
            p_beyond_border: unknown,
            nis: None,
            flags: Flags::NONE,
            angle_deg: None,
            angle_sd: None,
            header: Header::OHM_STRAIN,
        }
    }
}

/// Serialisation with the names of `estimates.csv`.
impl Serialize for Estimate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut row = serializer.serialize_struct("Estimate", self.header.len())?;
        for column in self.header.columns() {
            if column.is_flags() {
                row.serialize_field(column.name(), &self.flags)?;
            } else {
                let known = Some(column.number(self)).filter(|number| number.is_finite());
                row.serialize_field(column.name(), &known)?;
            }
        }
        row.end()
    }
}

/// Conversion of readings to the kernel's input, and of its output to rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// R₀ in the unit of the readings.
    pub rest_reading: f64,
    /// R₀ of the calibration, and the reading of the rested sensor then.
    calibrated: (f64, f64),
    pub limits: StrainRange<f64>,
    quantity: Quantity,
    joint: Option<Joint<f64>>,
    header: Header,
}

impl Scale {
    pub(crate) fn new(sensor: &Sensor) -> Result<Self, Error> {
        let params: &SensorParams = sensor.params();
        let SensorParams { rest_reading, limits, quantity, .. } = *params;
        let calibrated = (rest_reading, params.rested());
        Ok(Self { rest_reading, calibrated, limits, quantity, joint: sensor.joint()?, header: Header::of(params) })
    }

    /// Sets R₀ for a rested sensor that reads `measured`.
    pub(crate) fn rest_at(&mut self, measured: f64) -> Result<(), Error> {
        let (rest_reading, rested) = self.calibrated;
        check_rest(rested, measured)?;
        self.rest_reading = rest_reading * (measured / rested);
        Ok(())
    }

    /// Returns a known strain with standard deviation `sd`; refuses one far beyond the limits.
    pub(crate) fn known(&self, strain: f64, sd: f64) -> Result<Gaussian<f64>, Error> {
        check_known("known strain", strain, self.limits, self.quantity)?;
        if !(sd.is_finite() && sd > 0.0) {
            return Err(Error::NotPositive { name: "standard deviation of a known strain", found: sd });
        }
        Ok(Gaussian { mean: strain, variance: sd * sd })
    }

    /// Returns the row of a reading and the filter's output.
    pub(crate) fn row(&self, time_s: f64, reading: Reading, output: &Output) -> Estimate {
        let rest_reading = self.rest_reading * (1.0 + output.rest_off);
        let estimate = &output.estimate;
        let strain = (estimate.strain.mean, estimate.strain.sd());
        let angle = self.joint.map(|joint| joint.angle_rad(strain.0, strain.1));
        let settled = settled(output);
        Estimate {
            time_s,
            resistance: Some(reading.value).filter(|value| !value.is_nan()),
            strain: strain.0,
            strain_sd: strain.1,
            strain_rate: estimate.rate.mean,
            strain_rate_sd: estimate.rate.sd(),
            relaxation: estimate.relaxation.mean,
            relaxation_sd: estimate.relaxation.sd(),
            baseline: estimate.baseline,
            settled_resistance: rest_reading * (1.0 + settled.mean),
            settled_resistance_sd: rest_reading * settled.sd(),
            p_extend: output.phases.map(|phases| phases[0]),
            p_hold: output.phases.map(|phases| phases[1]),
            p_retract: output.phases.map(|phases| phases[2]),
            p_beyond_border: estimate.beyond_border,
            nis: output.nis,
            flags: self.flags(reading, output),
            angle_deg: angle.map(|(angle, _)| angle.to_degrees()),
            angle_sd: angle.map(|(_, sd)| sd.to_degrees()),
            header: self.header,
        }
    }

    fn flags(&self, reading: Reading, output: &Output) -> Flags {
        let (strain, verdict) = (output.estimate.strain.mean, output.verdict);
        Flags::NONE
            .with(Flag::Missing, reading.value.is_nan() && !reading.saturated)
            .with(Flag::Saturated, reading.saturated)
            .with(Flag::Rejected, verdict == ReadingVerdict::Rejected)
            .with(Flag::Downweighted, surprises(output))
            .with(Flag::Implausible, verdict == ReadingVerdict::Implausible || reading.value.is_infinite())
            .with(Flag::Stuck, verdict == ReadingVerdict::Stuck)
            .with(Flag::Readmitted, verdict == ReadingVerdict::Readmitted)
            .with(Flag::RampBorder, output.estimate.near_ramp_border)
            .with(Flag::AtLimit, strain <= self.limits.lower || strain >= self.limits.upper)
            .and(output.doubts)
    }
}

/// Refuses a known strain that lies beyond the limits by more than a tenth of their span.
pub(crate) fn check_known(
    name: &'static str,
    strain: f64,
    limits: StrainRange<f64>,
    quantity: Quantity,
) -> Result<(), Error> {
    let StrainRange { lower, upper } = limits;
    if (lower - strain).max(strain - upper) <= KNOWN_BEYOND * limits.span() {
        return Ok(());
    }
    Err(Error::KnownStrain { name, quantity, lower, upper, found: strain })
}

/// Refuses an R₀ that is too far from the reading `rested` of the rested sensor in calibration.
pub(crate) fn check_rest(rested: f64, measured: f64) -> Result<(), Error> {
    if !(measured.is_finite() && measured > 0.0) {
        return Err(Error::NotPositive { name: "resistance at rest", found: measured });
    }
    let moved = measured / rested;
    if (FARTHEST_REST.recip()..=FARTHEST_REST).contains(&moved) {
        return Ok(());
    }
    Err(Error::FarRest { rested, found: measured })
}

/// True if the row's reading was downweighted because it was far from the expected one.
fn surprises(output: &Output) -> bool {
    output.verdict == ReadingVerdict::Downweighted && output.nis.is_none_or(|nis| nis > SURPRISING_NIS)
}

/// Returns R/R₀ - 1 after a hold. The reading is a better start of the relaxation than the law. A surprising reading may be
/// wrong, so that its distance from the law enters the variance.
fn settled(output: &Output) -> Gaussian<f64> {
    let estimate = &output.estimate;
    let falls = estimate.still_relaxes;
    let Some(reading) = output.reading.filter(|_| output.verdict.is_taken()) else { return estimate.settled() };
    let surprise = if surprises(output) { reading.value - estimate.held.mean } else { 0.0 };
    let variance = falls.variance.max(surprise * surprise) + reading.extra_variance;
    Gaussian { mean: reading.value - falls.mean, variance }
}
