use std::sync::Arc;

#[cfg(feature = "calibrate")]
use ohmstrain_calib::{FusionChannel, Samples, fit_fusion};
use ohmstrain_model::Joint;
use ohmstrain_sensor::Quantity;
use ohmstrain_sensor::fusion::{ChannelState, FUSION_FORMAT, Fusion, FusionParams, Member};

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use crate::text::{self, Document};
#[cfg(feature = "calibrate")]
use crate::{Calibrated, MADE_BY, Recording, Scores};
use crate::{Error, Estimate, FieldError, Filter, FilterBuilder, Flag, Reading, Sensor};

impl Document for FusionParams {
    const FORMAT: u32 = FUSION_FORMAT;

    fn check(&self) -> Result<(), FieldError> {
        self.validate()
    }

    fn converted(document: Spanned<DeTable<'_>>, format: u32) -> Option<Result<Self, toml::de::Error>> {
        (format == 1).then(|| of_format_1(document))
    }
}

/// Converts a document of format 1, which has errors of filters and regressions together only.
fn of_format_1(mut document: Spanned<DeTable<'_>>) -> Result<FusionParams, toml::de::Error> {
    let span = document.span();
    let table = document.get_mut();
    let mut errors = DeTable::new();
    for (old, new) in [("sd_scale", "sd_scale"), ("error_covariance", "covariance")] {
        if let Some(value) = table.remove(old) {
            errors.insert(Spanned::new(span.clone(), new.into()), value);
        }
    }
    table.insert(Spanned::new(span.clone(), "errors".into()), Spanned::new(span, DeValue::Table(errors)));
    Ok(FusionParams { format: FUSION_FORMAT, ..FusionParams::deserialize(Deserializer::from(document))? })
}

/// Several sensors that measure one strain, with the calibrated parameters of their fusion.
///
/// ```no_run
/// use ohmstrain::{FusedSensor, Sensor};
///
/// let sensors = vec![
///     Sensor::from_toml(&std::fs::read_to_string("knee-knit1.toml")?)?,
///     Sensor::from_toml(&std::fs::read_to_string("knee-knit2.toml")?)?,
/// ];
/// let knee = FusedSensor::from_toml(sensors, &std::fs::read_to_string("knee-fusion.toml")?)?;
/// let mut filter = knee.filter()?;
/// let e = filter.step(0.0, &[1.02.into(), 1.31.into()])?;
/// println!("{:.1} ± {:.1}", e.strain, e.strain_sd);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct FusedSensor {
    sensors: Vec<Sensor>,
    params: Arc<FusionParams>,
}

impl FusedSensor {
    /// Fuses sensors by the text of a fusion file.
    ///
    /// # Errors
    /// With line and column if the text is not a fusion; or if the number or the quantity of the sensors differs.
    pub fn from_toml(sensors: Vec<Sensor>, text: &str) -> Result<Self, Error> {
        Self::new(sensors, text::parse(text)?)
    }

    /// Fuses sensors by these parameters. Their readings are not converted to one temperature: a sensor with an effect of temperature has
    /// wider intervals.
    ///
    /// # Errors
    /// If their number or quantity of the sensors differs.
    pub fn new(sensors: Vec<Sensor>, params: FusionParams) -> Result<Self, Error> {
        if sensors.len() != params.channels() {
            return Err(Error::OtherChannels { expected: params.channels(), found: sensors.len() });
        }
        if sensors.iter().any(|sensor| sensor.params().quantity != params.quantity) {
            return Err(Error::OtherQuantity);
        }
        let sensors = sensors.into_iter().map(Sensor::without_temperature).collect();
        Ok(Self { sensors, params: Arc::new(params) })
    }

    /// Returns the text of its fusion file, which [`Self::from_toml`] reads.
    ///
    /// # Errors
    /// If TOML cannot represent a number.
    pub fn to_toml(&self) -> Result<String, Error> {
        Ok(toml::to_string(self.params.as_ref())?)
    }

    /// Returns the sensors of its channels.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Returns all its numbers except those of the sensors.
    #[must_use]
    pub fn params(&self) -> &FusionParams {
        &self.params
    }

    /// Returns the estimated quantity.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.params.quantity
    }

    /// Builds a filter of all channels, each with the default estimator of its sensor.
    ///
    /// # Errors
    /// If the filter of a channel cannot be built.
    pub fn filter(&self) -> Result<FusedFilter, Error> {
        let filters = self.sensors.iter().map(|sensor| sensor.filter().build()).collect::<Result<_, _>>()?;
        self.filter_of(filters)
    }

    /// Builds a fused filter from filters of its sensors, in their order; these may have another R₀, for example.
    ///
    /// # Errors
    /// If their number differs, or the joint of the first sensor is invalid.
    pub fn filter_of(&self, filters: Vec<Filter>) -> Result<FusedFilter, Error> {
        if filters.len() != self.sensors.len() {
            return Err(Error::OtherChannels { expected: self.sensors.len(), found: filters.len() });
        }
        Ok(FusedFilter { filters, running: Running::new(Fusion::new(Arc::clone(&self.params)), &self.sensors)? })
    }

    /// Smooths a whole recording with the readings of each channel, one for each time.
    ///
    /// # Errors
    /// As [`FilterBuilder::smooth`], and as [`Self::smooth_of`].
    pub fn smooth(&self, time_s: &[f64], readings: &[&[Reading]]) -> Result<Vec<FusedEstimate>, Error> {
        self.smooth_of(self.sensors.iter().map(Sensor::filter).collect(), time_s, readings)
    }

    /// Smooths a whole recording with builders of its sensors, in their order; these may have another R₀, for example.
    ///
    /// # Errors
    /// If there are more or fewer builders or readings than channels and times, or if the fusion was not calibrated for smoothers;
    /// the row that was refused.
    pub fn smooth_of(
        &self,
        builders: Vec<FilterBuilder>,
        time_s: &[f64],
        readings: &[&[Reading]],
    ) -> Result<Vec<FusedEstimate>, Error> {
        let expected = self.sensors.len();
        for found in [builders.len(), readings.len()] {
            if found != expected {
                return Err(Error::OtherChannels { expected, found });
            }
        }
        let fusion = Fusion::of_smoothers(Arc::clone(&self.params)).ok_or(Error::NoFusedSmoother)?;
        let mut running = Running::new(fusion, &self.sensors)?;
        let (mut smoothed, mut rest_readings) = (Vec::new(), Vec::new());
        for (builder, readings) in builders.into_iter().zip(readings) {
            rest_readings.push(builder.build()?.rest_reading());
            smoothed.push(builder.smooth_readings(time_s, readings)?);
        }
        let row = |(k, time_s): (usize, &f64)| {
            running.fuse(*time_s, smoothed.iter().map(|rows| rows[k]).collect(), &rest_readings)
        };
        Ok(time_s.iter().enumerate().map(row).collect())
    }
}

/// A running filter of several channels: their readings in, one estimate out.
pub struct FusedFilter {
    filters: Vec<Filter>,
    running: Running,
}

/// Estimate of one strain from several channels.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FusedEstimate {
    /// Time, s.
    pub time_s: f64,
    /// Strain, or the quantity that the sensors were calibrated on.
    pub strain: f64,
    /// Its standard deviation.
    pub strain_sd: f64,
    /// Angle of the joint, degrees; `None` without a joint.
    pub angle_deg: Option<f64>,
    /// Its standard deviation.
    pub angle_sd: Option<f64>,
    /// Index of a channel that disagrees with all others and was left out.
    pub faulty: Option<usize>,
    /// True if the readings together are unlike any in the calibration: the interval is then nearly that of an unknown strain.
    pub is_unlike: bool,
    /// Estimate of each channel by itself.
    pub channels: Vec<Estimate>,
}

impl FusedFilter {
    /// Takes a reading of each channel. A missing reading is NaN, `None` or [`Reading::MISSING`].
    ///
    /// # Errors
    /// If there are more or fewer readings than channels, or time goes backwards. The filter stays as it was.
    pub fn step(&mut self, time_s: f64, readings: &[Reading]) -> Result<FusedEstimate, Error> {
        if readings.len() != self.filters.len() {
            return Err(Error::OtherChannels { expected: self.filters.len(), found: readings.len() });
        }
        let each = self.filters.iter_mut().zip(readings);
        let channels = each.map(|(filter, reading)| filter.step(time_s, *reading)).collect::<Result<Vec<_>, _>>()?;
        let rest_readings: Vec<f64> = self.filters.iter().map(Filter::rest_reading).collect();
        Ok(self.running.fuse(time_s, channels, &rest_readings))
    }
}

/// A running fusion, and the joint that the sensors span.
struct Running {
    fusion: Fusion,
    joint: Option<Joint<f64>>,
}

impl Running {
    fn new(fusion: Fusion, sensors: &[Sensor]) -> Result<Self, Error> {
        let with_joint = sensors.iter().find(|sensor| sensor.params().joint.is_some());
        Ok(Self { fusion, joint: with_joint.map(Sensor::joint).transpose()?.flatten() })
    }

    /// Fuses the channels' estimates of a row.
    fn fuse(&mut self, time_s: f64, channels: Vec<Estimate>, rest_readings: &[f64]) -> FusedEstimate {
        let states: Vec<ChannelState> =
            channels.iter().zip(rest_readings).map(|(row, rest_reading)| state(row, *rest_reading)).collect();
        let fused = self.fusion.step(time_s, &states);
        let angle = self.joint.map(|joint| joint.angle_rad(fused.strain, fused.sd));
        FusedEstimate {
            time_s,
            strain: fused.strain,
            strain_sd: fused.sd,
            angle_deg: angle.map(|(angle, _)| angle.to_degrees()),
            angle_sd: angle.map(|(_, sd)| sd.to_degrees()),
            faulty: fused.faulty,
            is_unlike: fused.is_unlike,
            channels,
        }
    }
}

/// Returns the state of a channel for the fusion, without a reading that its own filter rejects.
fn state(row: &Estimate, rest_reading: f64) -> ChannelState {
    const UNREAD: [Flag; 4] = [Flag::Missing, Flag::Saturated, Flag::Implausible, Flag::Stuck];
    let is_read = !UNREAD.iter().any(|flag| row.flags.has(*flag));
    let reading = row.resistance.filter(|reading| is_read && *reading > 0.0);
    ChannelState {
        ln_r: reading.map_or(f64::NAN, |reading| (reading / rest_reading).ln()),
        own: Member { strain: row.strain, sd: row.strain_sd },
    }
}

/// Fused sensor with its quality on held-out parts of the calibration.
#[cfg(feature = "calibrate")]
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Fused {
    /// The sensor.
    pub sensor: FusedSensor,
    /// Scores of the fused estimate; `None` if they could not be measured.
    pub scores: Option<Scores>,
    /// Scores of the fused smoothers.
    pub smoothed: Option<Scores>,
    /// Scores of each channel alone on the same rows.
    pub channels: Vec<Option<Scores>>,
}

/// Fuses channels that measure one strain. Each comes with its calibration and the recordings that it was calibrated on; rows
/// of all channels have the same times and strains.
///
/// # Errors
/// If there are fewer than two channels, if they are of different quantities, or if their recordings have no rows in common.
///
/// ```no_run
/// use ohmstrain::{Calibration, Recording, fuse};
///
/// fn knee(first: Recording, second: Recording) -> Result<ohmstrain::FusedSensor, ohmstrain::Error> {
///     let calibrated = [Calibration::new().run(&[first])?, Calibration::new().run(&[second])?];
///     Ok(fuse(&[(&calibrated[0], &[first]), (&calibrated[1], &[second])])?.sensor)
/// }
/// ```
#[cfg(feature = "calibrate")]
pub fn fuse(channels: &[(&Calibrated, &[Recording])]) -> Result<Fused, Error> {
    let sensors: Vec<Sensor> = channels.iter().map(|(calibrated, _)| calibrated.sensor.clone()).collect();
    let mut samples: Vec<Vec<Samples>> = Vec::new();
    for (_, recordings) in channels {
        samples.push(recordings.iter().map(|recording| recording.samples).collect());
    }
    let mut learned = Vec::new();
    for ((calibrated, _), samples) in channels.iter().zip(&samples) {
        let rest_reading = calibrated.sensor.params().rest_reading;
        learned.push(FusionChannel { recordings: samples, rest_reading, left_out: &calibrated.left_out });
    }
    let quantity = sensors.first().map_or(Quantity::Strain, |sensor| sensor.params().quantity);
    let fit = fit_fusion(&learned, quantity, MADE_BY)?;
    Ok(Fused {
        sensor: FusedSensor::new(sensors, fit.params)?,
        scores: fit.fused,
        smoothed: fit.smoothed,
        channels: fit.channels,
    })
}
