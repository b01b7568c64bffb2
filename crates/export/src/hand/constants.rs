//! Values for the templates of a hand.

use ohmstrain_sensor::ReadingUnit;
use ohmstrain_sensor::fusion::{PRIOR_SD, UNLIKE};
use serde::Serialize;

use super::fused::ChipFusion;
use super::twin::{HandVectors, Twin};
use super::{HandChannel, HandJoint};
use crate::literal::Literal;
use crate::prefix::WRITTEN;
use crate::{ExportError, Plan, cost};
use ohmstrain::MADE_BY;

/// Resistor of a divider that nothing is known of, Ω, as in the sketch of one sensor.
const SERIES_OHM: f32 = 10_000.0;
/// Largest code of its converter.
const FULL: f32 = 1023.0;
/// Bytes of code around the channels' filters on a Cortex-M4F, and bytes of a joint's state.
const CODE: usize = 3800;
const JOINT_STATE: usize = 16;
/// Instructions of a fusion there: for each kernel and each of its inputs, for each product with a triangle, for each row of the
/// calibration and each reading that is compared with it, and for each pair of members. Fits to counts in QEMU, which `scripts/exported-c.sh` repeats.
const KERNEL: f64 = 90.0;
const INPUT: f64 = 10.0;
const PRODUCT: f64 = 6.1;
const ROW: f64 = 15.0;
const COMPARED: f64 = 17.0;
const PAIR: f64 = 40.0;

/// A hand in the form that the templates take.
#[derive(Debug, Serialize)]
pub struct HandConstants {
    made_by: &'static str,
    version: &'static str,
    dt_s: Literal,
    dt_us: u64,
    dt_ms: f64,
    channels: Vec<ChannelConstants>,
    joints: Vec<JointConstants>,
    fusions: Vec<FusionConstants>,
    most: Most,
    prior_variance: Literal,
    unlike: Literal,
    vectors: HandVectors,
    /// Costs, line by line.
    pub costs: Vec<String>,
}

#[derive(Clone, Debug, Serialize)]
struct ChannelConstants {
    /// Name in C, and in capitals.
    stem: String,
    label: String,
    /// Prefix of its functions, and in capitals, as long as the templates' prefix stands.
    name: String,
    upper: String,
    column: String,
    unit: &'static str,
    is_ratio: bool,
    rest: Option<Literal>,
    series_ohm: Literal,
    /// True if the sensor lies between the supply and the pin.
    is_high: bool,
    /// Largest code of the converter.
    full: Literal,
}

#[derive(Debug, Serialize)]
struct JointConstants {
    name: String,
    upper: String,
    unit: &'static str,
    /// Columns of value and standard deviation, as `hand` names them.
    column: String,
    sd_column: String,
    /// Prefix and name of the first channel.
    first: String,
    first_stem: String,
    channels: Vec<ChannelConstants>,
    fused: bool,
    /// The value is `at_zero` + `per_strain` · strain.
    at_zero: Literal,
    per_strain: Literal,
}

#[derive(Debug, Serialize)]
struct FusionConstants {
    joint: String,
    #[serde(flatten)]
    fusion: ChipFusion<Literal>,
}

/// Sizes of arrays that hold any fusion.
#[derive(Debug, Default, Serialize)]
struct Most {
    channels: usize,
    members: usize,
    inputs: usize,
    inducing: usize,
    low_passes: usize,
}

impl HandConstants {
    pub(super) fn new(joints: &[HandJoint], plan: &Plan, dt_s: f64) -> Result<Self, ExportError> {
        let twin = Twin::new(joints)?;
        let fused = || joints.iter().zip(&twin.fusions).filter_map(|(joint, fusion)| Some((joint, fusion.as_ref()?)));
        let mut most = Most::default();
        fused().for_each(|(_, fusion)| most.include(fusion));
        let of_joint = |(joint, per_strain): (&HandJoint, &(f32, f32))| joint_constants(joint, *per_strain);
        let of_fusion = |(joint, fusion): (&HandJoint, &ChipFusion<f32>)| FusionConstants {
            joint: name_in_c(&joint.name),
            fusion: fusion.map(Literal),
        };
        let costs = costs(joints, &twin, &most, plan, dt_s)?;
        let constants = Self {
            costs,
            made_by: MADE_BY,
            version: env!("CARGO_PKG_VERSION"),
            dt_s: Literal(dt_s as f32),
            dt_us: (1e6 * dt_s).round() as u64,
            dt_ms: (1e6 * dt_s).round() / 1e3,
            channels: joints.iter().flat_map(|joint| joint.channels.iter().map(|one| channel(joint, one))).collect(),
            joints: joints.iter().zip(&twin.scales).map(of_joint).collect(),
            fusions: fused().map(of_fusion).collect(),
            most,
            prior_variance: Literal((PRIOR_SD * PRIOR_SD) as f32),
            unlike: Literal(UNLIKE as f32),
            vectors: twin.vectors(joints, plan, dt_s)?,
        };
        let double = |mut names: Vec<String>| {
            names.sort_unstable();
            names.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0].clone())
        };
        let of_joints = double(constants.joints.iter().map(|joint| joint.name.clone()).collect());
        match of_joints.or_else(|| double(constants.channels.iter().map(|channel| channel.stem.clone()).collect())) {
            Some(name) => Err(ExportError::Parameter(format!(
                "expected joints and channels with a name each in C, found two of the name `{name}`"
            ))),
            None => Ok(constants),
        }
    }

    /// Returns the names of the channels in C.
    pub(super) fn channel_names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|channel| channel.stem.as_str())
    }
}

/// Returns a name in C: small letters, digits and underscores.
fn name_in_c(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_lowercase()) { plain } else { format!("c_{plain}") }
}

fn channel(joint: &HandJoint, channel: &HandChannel) -> ChannelConstants {
    // The only channel of a joint has its name.
    let unit = ["_ohm", "_ratio", "_adc"].into_iter().find_map(|unit| channel.column.strip_suffix(unit));
    let stem = name_in_c(if joint.channels.len() == 1 { &joint.name } else { unit.unwrap_or(&channel.column) });
    let is_ratio = channel.params.reading == ReadingUnit::Ratio;
    ChannelConstants {
        name: format!("{WRITTEN}_{stem}"),
        upper: format!("{WRITTEN}_{stem}").to_uppercase(),
        label: stem.to_uppercase(),
        stem,
        column: channel.column.clone(),
        unit: if is_ratio { "ratio" } else { "ohm" },
        is_ratio,
        rest: channel.rest_resistance.map(|measured| Literal(measured as f32)),
        series_ohm: Literal(channel.divider.map_or(SERIES_OHM, |divider| divider.reference_ohm as f32)),
        is_high: channel.divider.is_some_and(|divider| divider.is_high),
        full: Literal(channel.divider.map_or(FULL, |divider| divider.full as f32)),
    }
}

fn joint_constants(joint: &HandJoint, (at_zero, per_strain): (f32, f32)) -> JointConstants {
    let name = name_in_c(&joint.name);
    let [ending, sd_ending] = if joint.is_angle() { ["deg", "sd_deg"] } else { ["strain", "strain_sd"] };
    let channels: Vec<ChannelConstants> = joint.channels.iter().map(|one| channel(joint, one)).collect();
    JointConstants {
        upper: name.to_uppercase(),
        unit: if joint.is_angle() { "degrees" } else { "strain" },
        column: format!("{}_{ending}", joint.name),
        sd_column: format!("{}_{sd_ending}", joint.name),
        first: channels.first().map(|first| first.name.clone()).unwrap_or_default(),
        first_stem: channels.first().map(|first| first.stem.clone()).unwrap_or_default(),
        channels,
        fused: joint.fusion.is_some(),
        at_zero: Literal(at_zero),
        per_strain: Literal(per_strain),
        name,
    }
}

impl Most {
    fn include<T>(&mut self, fusion: &ChipFusion<T>) {
        let most = |number: &mut usize, other: usize| *number = (*number).max(other);
        most(&mut self.channels, fusion.per_sd.len());
        most(&mut self.members, fusion.all.covariance.len().max(fusion.filters.covariance.len()));
        most(&mut self.low_passes, fusion.low_pass_s.len());
        // An array has at least one entry in C.
        most(&mut self.inputs, 1);
        most(&mut self.inducing, 1);
        for process in &fusion.processes {
            most(&mut self.inputs, process.mean.len());
            most(&mut self.inducing, process.rows.len());
        }
    }
}

/// Cost of a fusion on a Cortex-M4F: instructions a step, and bytes of flash and of state.
fn cost_of<T>(fusion: &ChipFusion<T>) -> [usize; 3] {
    let (channels, rows) = (fusion.per_sd.len(), fusion.rows.len());
    let triangle = |n: usize| n * (n + 1) / 2;
    let (mut instructions, mut numbers) = ((ROW + COMPARED * channels as f64) * rows as f64, channels * (rows + 1));
    for process in &fusion.processes {
        let (n, inputs) = (process.rows.len(), process.mean.len());
        instructions += n as f64 * (KERNEL + INPUT * inputs as f64) + PRODUCT * 2.0 * triangle(n) as f64;
        numbers += 2 * inputs + n * (inputs + 1) + 2 * triangle(n);
    }
    let members = fusion.all.covariance.len();
    instructions += PAIR * members.pow(2) as f64;
    let covariances = fusion.all.covariance.len().pow(2) + fusion.filters.covariance.len().pow(2);
    let state = channels * (1 + fusion.low_pass_s.len());
    [instructions as usize, 4 * (numbers + covariances), 4 * state]
}

/// Returns the costs of all channels and fusions, line by line.
fn costs(joints: &[HandJoint], twin: &Twin, most: &Most, plan: &Plan, dt_s: f64) -> Result<Vec<String>, ExportError> {
    let (mut instructions, mut flash, mut state, mut stack) = (0, CODE, JOINT_STATE * joints.len(), 0);
    for channel in joints.iter().flat_map(|joint| &joint.channels) {
        let one = cost(channel.params, plan, dt_s)?;
        instructions += one.instructions;
        flash += one.flash;
        state += one.state;
        stack = stack.max(one.stack);
    }
    let mut lines = Vec::new();
    let mut line = |what: &str, [instructions, flash, state]: [usize; 3]| {
        lines.push(format!("{what}: {instructions} instructions a step, {flash} B of flash, {state} B of state"));
    };
    let channels = joints.iter().map(|joint| joint.channels.len()).sum::<usize>();
    line(&format!("filters of {channels} channels"), [instructions, flash, state]);
    for (joint, fusion) in joints.iter().zip(&twin.fusions) {
        if let Some(fusion) = fusion {
            let one = cost_of(fusion);
            line(&format!("fusion of `{}`", joint.name), one);
            (instructions, flash, state) = (instructions + one[0], flash + one[1], state + one[2]);
        }
    }
    line("all, estimated for a Cortex-M4F", [instructions, flash, state]);
    // One step calls the filters of all channels, and combines them in its own frame.
    let own = 4 * (most.inducing + most.inputs + most.members * (most.members + 4));
    lines.push(format!("and {} B of stack", stack + own));
    Ok(lines)
}
