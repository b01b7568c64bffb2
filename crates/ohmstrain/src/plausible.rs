use ohmstrain_calib::Confounded;
use ohmstrain_sensor::{Quantity, ReadingUnit, SensorParams};

use crate::unit_doubt::LEAST_OHM;
use crate::{Calibrated, CalibrationDoubt, Recording};
/// Smallest ratio of a sensor's smallest to its largest resistance; a strain falls to zero at rest.
const LEAST_OF_LARGEST: f64 = 0.2;
/// Joints turn by less than this, degrees.
const FULL_TURN_DEG: f64 = 360.0;
/// Ratio between recordings from which the unit must differ, since no sensor explains it.
const UNIT_RATIO: f64 = 20.0;
/// Ratios between recordings of one sensor from which a warning is due. R₀ drifts by a tenth or two from day to day, and the
/// readings' change per strain depends on how the sensor is mounted.
const REST_RATIO: f64 = 1.3;
const GAUGE_RATIO: f64 = 3.0;

/// Largest strain that is not taken for percent, unless the unit is known: four times the unstretched length.
const LARGEST_STRAIN: f64 = 3.0;
/// Change of the readings per strain below which a reference above one is taken for percent, too.
const LEAST_GAUGE: f64 = 0.05;

/// Returns doubts about the recordings of one calibration: about their units, and whether they are of one sensor. Refusals come
/// first, then warnings. Units that [are known](Recording::strain_unit_is_known) are not doubted.
///
/// ```
/// use ohmstrain::{CalibrationDoubt, Recording, calibration_doubts};
///
/// let time_s = [0.0, 0.1, 0.2];
/// let percent = Recording::new(&time_s, &[1600.0, 1650.0, 1700.0], &[0.0, 5.0, 10.0])?;
/// let [doubt] = calibration_doubts(&[percent])[..] else { panic!() };
/// assert!(matches!(doubt, CalibrationDoubt::Percent { recording: 0, .. }));
/// assert!(calibration_doubts(&[percent.strain_unit_is_known()]).is_empty());
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[must_use]
pub fn calibration_doubts(recordings: &[Recording]) -> Vec<CalibrationDoubt> {
    let known: Vec<(usize, Figures)> = recordings
        .iter()
        .enumerate()
        .filter_map(|(place, recording)| Some((place, Figures::new(recording)?)))
        .collect();
    let single = known.iter().filter_map(|(place, figures)| figures.doubt(&recordings[*place], *place));
    let mut doubts: Vec<_> = single.chain(apart(&known)).chain(copies(recordings)).collect();
    // Refusals come first.
    doubts.sort_by_key(|doubt| !doubt.is_refusal());
    doubts
}

/// Returns the two recordings that differ most in a value, with both values, if their ratio exceeds a factor.
fn farthest(values: &[(usize, f64)], factor: f64) -> Option<([usize; 2], [f64; 2])> {
    let least = values.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let most = values.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most.1 > factor * least.1).then_some(([least.0, most.0], [least.1, most.1]))
}

fn apart(known: &[(usize, Figures)]) -> Vec<CalibrationDoubt> {
    let of = |value: fn(&Figures) -> f64| known.iter().map(|(place, of)| (*place, value(of))).collect::<Vec<_>>();
    let medians = farthest(&of(|figures| figures.median), UNIT_RATIO)
        .map(|(recordings, medians)| CalibrationDoubt::ReadingsApart { recordings, medians });
    let gauges = of(|figures| figures.gauge);
    let references = farthest(&gauges, UNIT_RATIO)
        .map(|(recordings, gauges)| CalibrationDoubt::ReferencesApart { recordings, gauges });
    let unlike =
        farthest(&gauges, GAUGE_RATIO).map(|(recordings, gauges)| CalibrationDoubt::GaugesApart { recordings, gauges });
    medians.into_iter().chain(references.or(unlike)).collect()
}

fn copies(recordings: &[Recording]) -> Vec<CalibrationDoubt> {
    fn alike(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
    }
    let is_copy = |a: &Recording, b: &Recording| {
        let (a, b) = (&a.samples, &b.samples);
        alike(a.time_s(), b.time_s()) && alike(a.reading(), b.reading()) && alike(a.strain(), b.strain())
    };
    let copy = |(place, recording): (usize, &Recording)| {
        let first = recordings[..place].iter().position(|first| is_copy(first, recording))?;
        Some(CalibrationDoubt::Copy { recordings: [place, first] })
    };
    recordings.iter().enumerate().filter_map(copy).collect()
}

/// Characteristic numbers of a recording.
struct Figures {
    /// Least and largest reading.
    readings: (f64, f64),
    /// Median reading.
    median: f64,
    /// Least and largest value of the reference.
    references: (f64, f64),
    /// Range of the readings over their median, per range of the reference.
    gauge: f64,
}

impl Figures {
    /// Returns the numbers; `None` if nothing is known or nothing moves.
    fn new(recording: &Recording) -> Option<Self> {
        let sorted = |values: &[f64]| {
            let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            known.sort_by(f64::total_cmp);
            known
        };
        let (reading, reference) = (sorted(recording.samples.reading()), sorted(recording.samples.strain()));
        let ends = |of: &[f64]| Some((*of.first()?, *of.last()?));
        let (readings, references) = (ends(&reading)?, ends(&reference)?);
        let median = *reading.get(reading.len() / 2)?;
        let span = references.1 - references.0;
        let gauge = (readings.1 - readings.0) / median / span;
        (span > 0.0).then_some(Self { readings, median, references, gauge })
    }

    fn doubt(&self, of: &Recording, recording: usize) -> Option<CalibrationDoubt> {
        if self.is_exchanged(of.quantity) {
            let readings = crate::column::reading_column(of.reading);
            return Some(CalibrationDoubt::Exchanged { recording, readings, reference: of.quantity.name() });
        }
        let largest = self.references.0.abs().max(self.references.1.abs());
        let is_percent = largest > LARGEST_STRAIN || (largest > 1.0 && self.gauge < LEAST_GAUGE);
        if of.quantity == Quantity::Strain && !of.knows_strain_unit && is_percent {
            return Some(CalibrationDoubt::Percent { recording, largest, gauge: self.gauge });
        }
        let is_kiloohm = of.reading == ReadingUnit::Ohm && self.median < LEAST_OHM;
        (!of.knows_resistance_unit && is_kiloohm)
            .then_some(CalibrationDoubt::KiloOhm { recording, median: self.median })
    }

    /// True if the reference looks like readings, and the readings like strains.
    fn is_exchanged(&self, quantity: Quantity) -> bool {
        let (readings, references) = (self.readings, self.references);
        let least = if quantity == Quantity::AngleDeg { FULL_TURN_DEG.max(readings.1) } else { readings.1 };
        references.0 > least
            && references.0 > LEAST_OF_LARGEST * references.1
            && readings.0 < LEAST_OF_LARGEST * readings.1
    }
}

impl Calibrated {
    /// Returns warnings about the result: R₀ that differs between recordings, and intervals for which the law is too wrong.
    ///
    /// ```
    /// fn warn(calibrated: &ohmstrain::Calibrated) {
    ///     calibrated.doubts().iter().for_each(|doubt| eprintln!("{doubt}"));
    /// }
    /// ```
    #[must_use]
    pub fn doubts(&self) -> Vec<CalibrationDoubt> {
        let rests: Vec<(usize, f64)> = self.rest_readings.iter().copied().enumerate().collect();
        let rests =
            farthest(&rests, REST_RATIO).map(|(recordings, rests)| CalibrationDoubt::RestsApart { recordings, rests });
        let params: &SensorParams = self.sensor.params();
        let temperature = self.confounded_temperature.map(|Confounded { range_k, coefficients, .. }| {
            CalibrationDoubt::Temperature { range_k, rest_per_k: coefficients.rest_per_k }
        });
        let widened = params.widened_most().into_iter().map(|of| CalibrationDoubt::Widened { of });
        rests.into_iter().chain(temperature).chain(widened).collect()
    }
}
