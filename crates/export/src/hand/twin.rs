//! Twin of an exported hand: the numbers that its self-test expects.

use ohmstrain_sensor::SensorParams;
use serde::Serialize;

use super::fused::{ChipChannel, ChipFused, ChipFusion};
use super::{HandChannel, HandJoint};
use crate::literal::Literal;
use crate::replay::replay_from;
use crate::vectors::{FURTHER, ROUNDINGS, other_rounding};
use crate::{ChipEstimate, ExportError, Plan, ReplayedRow};

/// Number of rows of the self-test, and of rows between two of the calibration; one channel of each fused joint is open in some, and has
/// another gain in others.
const ROWS: usize = 120;
const BETWEEN: usize = 4;
const OPEN: std::ops::Range<usize> = 60..70;
const OTHER_GAIN: std::ops::Range<usize> = 80..95;
const GAIN: f64 = 1.8;
/// Number of beginnings that are tried: where rounding decides which hypotheses are merged nothing can be compared.
const BEGINNINGS: usize = 6;
/// Flags of a reading that the filter does not use: missing, implausible, stuck.
const UNREAD: u32 = 1 | 2 | 4;
/// Least difference that is allowed, standard deviations: implementations of `expf` and `logf` differ by a unit in the last place.
const LEAST_SD: f64 = 1e-3;

/// All joints as the exported code has them.
pub struct Twin {
    /// Fusion of each joint with several channels.
    pub fusions: Vec<Option<ChipFusion<f32>>>,
    /// Value at zero strain, and per strain, of each joint.
    pub scales: Vec<(f32, f32)>,
}

/// Readings of all channels, and expected estimates of all joints.
#[derive(Debug, Serialize)]
pub struct HandVectors {
    readings: Vec<Vec<Option<Literal>>>,
    expected: Vec<Vec<Literal>>,
    /// Index of the faulty channel, -1 for none, -2 for readings unlike the calibration's.
    doubts: Vec<Vec<i32>>,
    tolerance_sd: Literal,
}

/// Rows of a joint: strain, standard deviation, and doubt.
type JointRows = Vec<(f64, f64, Doubt)>;

/// Doubt of a row: none, a faulty channel, or readings that are unlike the calibration's.
#[derive(Clone, Copy, PartialEq)]
enum Doubt {
    None,
    Faulty(usize),
    Unlike,
}

impl Twin {
    pub(super) fn new(joints: &[HandJoint]) -> Result<Self, ExportError> {
        let fusion = |joint: &HandJoint| {
            let fusion = joint.fusion.map(ChipFusion::new).transpose()?;
            Ok(fusion.map(|fusion| fusion.map(|number| number as f32)))
        };
        let scale = |joint: &HandJoint| {
            joint.joint.map_or((0.0, 1.0), |joint| {
                let per_strain = (joint.gauge_length_mm / joint.moment_arm_mm).to_degrees();
                ((-joint.prestrain * per_strain) as f32, per_strain as f32)
            })
        };
        Ok(Self {
            fusions: joints.iter().map(fusion).collect::<Result<_, ExportError>>()?,
            scales: joints.iter().map(scale).collect(),
        })
    }

    /// Runs all joints over readings that are made up, from the beginning on which rounding has the least effect.
    pub(super) fn vectors(&self, joints: &[HandJoint], plan: &Plan, dt_s: f64) -> Result<HandVectors, ExportError> {
        let mut calmest: Option<(f64, Vec<Vec<f64>>, Vec<JointRows>)> = None;
        for beginning in 0..BEGINNINGS {
            let readings: Vec<Vec<f64>> =
                joints.iter().flat_map(|joint| readings(joint, beginning * ROWS / BETWEEN)).collect();
            let (rows, mut effect) = self.run(joints, plan, dt_s, &readings)?;
            for seed in 0..ROUNDINGS {
                let mut rounded = other_rounding(seed);
                let mut rounded = |reading: &f64| f64::from(rounded(*reading));
                let others: Vec<Vec<f64>> =
                    readings.iter().map(|of_channel| of_channel.iter().map(&mut rounded).collect()).collect();
                let (other, _) = self.run(joints, plan, dt_s, &others)?;
                effect = rows.iter().zip(&other).map(|(rows, other)| farthest(rows, other)).fold(effect, f64::max);
            }
            if calmest.as_ref().is_none_or(|(least, ..)| effect < *least) {
                calmest = Some((effect, readings, rows));
            }
        }
        let (effect, readings, rows) = calmest.unwrap_or_default();
        if !effect.is_finite() {
            let what = "rounding decides which channel is left out, wherever the self-test begins";
            return Err(ExportError::Parameter(what.into()));
        }
        Ok(HandVectors {
            readings: (0..ROWS).map(|k| readings.iter().map(|of_channel| literal(of_channel[k])).collect()).collect(),
            expected: (0..ROWS).map(|k| self.expected(&rows, k)).collect(),
            doubts: (0..ROWS).map(|k| doubts(joints, &rows, k)).collect(),
            tolerance_sd: Literal((FURTHER * effect).max(LEAST_SD) as f32),
        })
    }

    /// Returns the rows of every joint, and the largest effect of single precision on a fusion, in standard deviations.
    fn run(
        &self,
        joints: &[HandJoint],
        plan: &Plan,
        dt_s: f64,
        readings: &[Vec<f64>],
    ) -> Result<(Vec<JointRows>, f64), ExportError> {
        let (mut rows, mut effect, mut rest) = (Vec::new(), 0.0_f64, readings);
        for (joint, fusion) in joints.iter().zip(&self.fusions) {
            let (own, others) = rest.split_at(joint.channels.len());
            rest = others;
            let of_channel = |(channel, readings): (&HandChannel, &Vec<f64>)| {
                channel_rows(channel.params, plan, dt_s, readings, channel.rest_resistance)
            };
            let channels: Vec<Vec<ChipEstimate>> =
                joint.channels.iter().zip(own).map(of_channel).collect::<Result<_, _>>()?;
            let Some(fusion) = fusion else {
                rows.push(channels[0].iter().map(|row| (row.strain.into(), row.sd.into(), Doubt::None)).collect());
                continue;
            };
            let rest: Vec<f64> = joint.channels.iter().map(rest_reading).collect();
            let (fused, of_joint) = fused_rows(fusion, &channels, own, &rest, dt_s);
            effect = effect.max(of_joint);
            rows.push(fused);
        }
        Ok((rows, effect))
    }

    /// Returns value and standard deviation of all joints in a row.
    fn expected(&self, rows: &[JointRows], k: usize) -> Vec<Literal> {
        let of_joint = |(rows, (at_zero, per_strain)): (&JointRows, &(f32, f32))| {
            let (strain, sd, _) = rows[k];
            [Literal(*per_strain * strain as f32 + at_zero), Literal(per_strain.abs() * sd as f32)]
        };
        rows.iter().zip(&self.scales).flat_map(of_joint).collect()
    }
}

/// Returns the doubts of all joints in a row, as the self-test has them.
fn doubts(joints: &[HandJoint], rows: &[JointRows], k: usize) -> Vec<i32> {
    let mut first = 0;
    let of_joint = |(joint, rows): (&HandJoint, &JointRows)| {
        let place = match rows[k].2 {
            Doubt::None => -1,
            Doubt::Faulty(channel) => i32::try_from(first + channel).unwrap_or(i32::MAX),
            Doubt::Unlike => -2,
        };
        first += joint.channels.len();
        place
    };
    joints.iter().zip(rows).map(of_joint).collect()
}

/// Returns the largest difference of two runs, in standard deviations; infinite if they doubt different rows.
fn farthest(rows: &JointRows, others: &JointRows) -> f64 {
    let of_row = |(row, other): (&(f64, f64, Doubt), &(f64, f64, Doubt))| {
        if row.2 == other.2 { (row.0 - other.0).abs().max((row.1 - other.1).abs()) / row.1 } else { f64::INFINITY }
    };
    rows.iter().zip(others).map(of_row).fold(0.0, f64::max)
}

fn literal(reading: f64) -> Option<Literal> {
    (!reading.is_nan()).then_some(Literal(reading as f32))
}

/// Returns R₀ of a channel: that of the law, changed as the reading at rest has.
fn rest_reading(channel: &HandChannel) -> f64 {
    let measured = channel.rest_resistance.map_or(1.0, |measured| measured / channel.params.rested());
    channel.params.rest_reading * measured
}

/// Returns readings of a joint's channels: through the fusion's rows from `first` on, or up and down through the calibrated range.
fn readings(joint: &HandJoint, first: usize) -> Vec<Vec<f64>> {
    let of_channel = |(place, channel): (usize, &HandChannel)| {
        let rest = rest_reading(channel);
        let reading = |k: usize| match joint.fusion {
            Some(fusion) => {
                let at = |row: usize| fusion.rows[row % fusion.rows.len()].ln_r[place];
                let (row, share) = (first + k / BETWEEN, (k % BETWEEN) as f64 / BETWEEN as f64);
                let reading = rest * (at(row) + share * (at(row + 1) - at(row))).exp();
                match place {
                    0 if OPEN.contains(&k) => f64::NAN,
                    1 if OTHER_GAIN.contains(&k) => GAIN * reading,
                    _ => reading,
                }
            }
            None => {
                let (lower, upper) = (channel.params.validity.reading_lower, channel.params.validity.reading_upper);
                let phase = std::f64::consts::TAU * (first + k) as f64 / 40.0;
                let scale = rest / channel.params.rest_reading;
                if k % 17 == 11 { f64::NAN } else { scale * (lower + 0.5 * (1.0 - phase.cos()) * (upper - lower)) }
            }
        };
        // The board has the readings in single precision.
        (0..ROWS).map(|k| f64::from(reading(k) as f32)).collect()
    };
    joint.channels.iter().enumerate().map(of_channel).collect()
}

/// Returns what the exported filter of a channel makes of its readings.
fn channel_rows(
    params: &SensorParams,
    plan: &Plan,
    dt_s: f64,
    readings: &[f64],
    rest: Option<f64>,
) -> Result<Vec<ChipEstimate>, ExportError> {
    let row = |reading: &f64| ReplayedRow { since_s: dt_s as f32, reading: *reading, reading_sd: 0.0 };
    replay_from(params, plan, dt_s, rest, &readings.iter().map(row).collect::<Vec<_>>())
}

/// Fuses the channels in single and in double precision; returns the rows, and the largest difference in standard deviations.
fn fused_rows(
    fusion: &ChipFusion<f32>,
    channels: &[Vec<ChipEstimate>],
    readings: &[Vec<f64>],
    rest: &[f64],
    dt_s: f64,
) -> (JointRows, f64) {
    let exact = fusion.map(f64::from);
    let (mut state, mut exact_state) = (fusion.start(), exact.start());
    let (mut rows, mut largest) = (Vec::new(), 0.0_f64);
    for k in 0..ROWS {
        let of_channel = |(channel, rows): (usize, &Vec<ChipEstimate>)| {
            let (estimate, reading) = (&rows[k], readings[channel][k] as f32);
            let is_read = reading > 0.0 && estimate.flags & UNREAD == 0;
            let ln_r = if is_read { (reading / rest[channel] as f32).ln() } else { f32::NAN };
            ChipChannel { ln_r, strain: estimate.strain, sd: estimate.sd }
        };
        let single: Vec<ChipChannel<f32>> = channels.iter().enumerate().map(of_channel).collect();
        let double: Vec<ChipChannel<f64>> = single
            .iter()
            .map(|one| ChipChannel { ln_r: one.ln_r.into(), strain: one.strain.into(), sd: one.sd.into() })
            .collect();
        let row: ChipFused<f32> = fusion.step(&mut state, dt_s as f32, &single);
        let expected: ChipFused<f64> = exact.step(&mut exact_state, f64::from(dt_s as f32), &double);
        let (strain, sd) = (f64::from(row.strain), f64::from(row.sd));
        largest =
            largest.max((strain - expected.strain).abs() / expected.sd).max((sd - expected.sd).abs() / expected.sd);
        let doubt = row.faulty.map_or(if row.is_unlike { Doubt::Unlike } else { Doubt::None }, Doubt::Faulty);
        rows.push((strain, sd, doubt));
    }
    (rows, largest)
}
