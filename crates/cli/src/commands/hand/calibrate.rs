//! Calibration of all channels of a recording: a sensor file for each channel, and a description of their joints.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ohmstrain::trace::{HAND_FORMAT, HandChannel, TraceFile, check_alike, known_recordings};
use ohmstrain::{Calibrated, Fused, MADE_BY, Recording, fuse};
use ohmstrain_calib::Samples;
use ohmstrain_report::Sample;
use serde::Serialize;

use super::refuse_flags;
use super::scores::{self, ChannelScores, JointScores};
use crate::args::CalibrateArgs;
use crate::channels::{Channel, Table, reference};
use crate::commands::calibrate::{calibrate_recordings, calibration, rows_in};
use crate::error::CliError;
use crate::marks;
use crate::messages::Messages;
use crate::output::{Claim, Kind, Outputs, print};
use crate::progress::Progress;
use crate::sensor_file;

/// `hand.toml` as it is written.
#[derive(Serialize)]
struct Written {
    format: u32,
    made_by: &'static str,
    joints: Vec<WrittenJoint>,
}

/// An entry of `hand.toml`: a joint with one channel or with several.
#[derive(Serialize)]
struct WrittenJoint {
    name: String,
    #[serde(flatten)]
    only: Option<HandChannel>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fusion: Option<PathBuf>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    channels: Vec<HandChannel>,
}

/// Channels of one joint.
struct Group {
    name: String,
    channels: Vec<Channel>,
}

/// Calibrates every channel, fuses those of one joint, and writes the description of all.
pub fn run(args: &CalibrateArgs, tables: &[Table], messages: &Messages) -> Result<(), CliError> {
    refuse_flags(
        [
            ("--report", args.report.report.is_some()),
            ("--figures", args.report.figures.is_some()),
            ("--explain", args.explain),
            ("--bootstrap", args.bootstrap.is_some()),
            ("--marks", !args.marks.is_empty()),
            ("--align", args.align),
            ("--prior", args.prior.is_some()),
            ("--temperature", args.temperature.is_some()),
        ],
        OF_ONE_CHANNEL,
    )?;
    let stem = args.output.file_stem().map_or_else(|| "hand".into(), |stem| stem.to_string_lossy().into_owned());
    let groups = groups(tables, &stem)?;
    let mut outputs = Outputs::new(args.replace.force, &args.traces);
    let hand = outputs.claim(&args.output, Kind::Hand)?;
    let mut claimed = Vec::new();
    for group in &groups {
        claimed.push(Files::claim(group, &args.output, &stem, &mut outputs)?);
    }
    let (mut written, mut scored) = (Vec::new(), Vec::new());
    for (group, files) in groups.iter().zip(claimed) {
        let (joint, scores) = group.calibrate(args, tables, files, &mut outputs, messages)?;
        written.push(joint);
        scored.push(scores);
    }
    let text = toml::to_string(&Written { format: HAND_FORMAT, made_by: MADE_BY, joints: written });
    outputs.put(hand, text.map_err(|error| CliError::Other(format!("cannot write the description: {error}")))?);
    outputs.publish()?;
    if messages.is_quiet() && !args.json {
        return Ok(());
    }
    let file = args.output.display();
    let heading = format!("{file}: each quarter of the recordings estimated with what the other quarters say");
    print(|out| scores::write(out, &heading, &scored, args.json))
}

/// Reason to refuse a flag.
const OF_ONE_CHANNEL: &str =
    "is for recordings of one channel, and these have a column of readings for each of several";

/// Groups channels by their common reference. A reference with a name of its own names the joint; one for all channels takes
/// the name of the output.
fn groups(tables: &[Table], stem: &str) -> Result<Vec<Group>, CliError> {
    let (mut places, mut groups): (BTreeMap<String, usize>, Vec<Group>) = (BTreeMap::new(), Vec::new());
    let first = tables.first().map_or_else(|| Ok(Vec::new()), Table::channels)?;
    for table in tables {
        let found = table.channels()?;
        refuse_double(table, &found)?;
        if found != first {
            let names =
                |channels: &[Channel]| channels.iter().map(|one| one.column.as_str()).collect::<Vec<_>>().join(", ");
            return Err(CliError::Input(format!(
                "{}: expected the channels of the first recording, {}, found {}",
                table.header_name(),
                names(&first),
                names(&found)
            )));
        }
    }
    for channel in first {
        let own = reference(&channel.reference).map_or("", |(own, _)| own);
        let place = *places.entry(channel.reference.clone()).or_insert(groups.len());
        if place == groups.len() {
            let name = plain(if own.is_empty() { stem } else { own });
            groups.push(Group { name, channels: Vec::new() });
        }
        groups[place].channels.push(channel);
    }
    Ok(groups)
}

/// Refuses two channels of one name: a sensor file is called like its channel.
fn refuse_double(table: &Table, channels: &[Channel]) -> Result<(), CliError> {
    let other = |(k, channel): (usize, &Channel)| {
        let other = channels[..k].iter().find(|other| plain(&other.name) == plain(&channel.name))?;
        Some((channel.column.clone(), other.column.clone()))
    };
    match channels.iter().enumerate().find_map(other) {
        Some((column, other)) => Err(CliError::Input(format!(
            "{}: column `{column}`: expected a name of its own, found another column `{other}`",
            table.header_name()
        ))),
        None => Ok(()),
    }
}

/// Replaces characters that names of joints may not have.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || "_-.".contains(c) { c } else { '_' }).collect()
}

/// Files of a joint.
struct Files {
    sensors: Vec<(PathBuf, Claim)>,
    fusion: Option<(PathBuf, Claim)>,
}

impl Files {
    /// Claims the files beside the description: hand-index.toml for the channel index, hand-fusion.toml for the fusion.
    fn claim(group: &Group, hand: &Path, stem: &str, outputs: &mut Outputs) -> Result<Self, CliError> {
        let folder = hand.parent().unwrap_or(Path::new(""));
        let mut claim = |name: String, kind: Kind| -> Result<(PathBuf, Claim), CliError> {
            let claim = outputs.claim(&folder.join(&name), kind)?;
            Ok((name.into(), claim))
        };
        let sensor = |channel: &Channel| format!("{stem}-{}.toml", plain(&channel.name));
        let sensors = group.channels.iter().map(|one| claim(sensor(one), Kind::Sensor)).collect::<Result<_, _>>()?;
        let of_joint = if group.name == plain(stem) { String::new() } else { format!("-{}", group.name) };
        let fusion = group.channels.len() > 1;
        let fusion = fusion.then(|| claim(format!("{stem}{of_joint}-fusion.toml"), Kind::Fusion)).transpose()?;
        Ok(Self { sensors, fusion })
    }
}

impl Group {
    fn calibrate(
        &self,
        args: &CalibrateArgs,
        tables: &[Table],
        files: Files,
        outputs: &mut Outputs,
        messages: &Messages,
    ) -> Result<(WrittenJoint, JointScores), CliError> {
        let recordings = self.recordings(args, tables, messages)?;
        let mut calibrated = Vec::new();
        for (channel, traces) in self.channels.iter().zip(&recordings) {
            let progress = Progress::new("calibrating", messages);
            let name = format!("channel `{}`", channel.column);
            messages.detail(&name);
            let found = calibrate_recordings(traces, calibration(args), &progress);
            calibrated.push(found.map_err(|error| error.named(&name))?);
        }
        let mut entries = Vec::new();
        for (k, (path, claim)) in files.sensors.into_iter().enumerate() {
            outputs.put(claim, sensor_file::text(&calibrated[k].sensor)?);
            let column = self.channels[k].column.clone();
            let first = recordings[k].first().filter(|first| first.trace.readings.converter.is_some());
            let front_end = first.and_then(|first| first.trace.metadata.front_end);
            entries.push(HandChannel { column, sensor: path, rest_resistance: None, front_end });
        }
        let name = self.name.clone();
        let Some((path, claim)) = files.fusion else {
            let findings = calibrated.first().and_then(|one| one.findings.as_ref());
            let (alone, smoothed) = (findings.map(|found| found.filter), findings.and_then(|found| found.smoother));
            let scores =
                JointScores { joint: name.clone(), sample: Sample::Out, fused: alone, smoothed, channels: Vec::new() };
            return Ok((WrittenJoint { name, only: entries.pop(), fusion: None, channels: Vec::new() }, scores));
        };
        let fused = fused(&recordings, &calibrated)?;
        outputs.put(claim, fused.sensor.to_toml()?);
        let columns = self.channels.iter().map(|channel| channel.column.clone());
        let channels = columns
            .zip(fused.channels)
            .map(|(column, alone)| ChannelScores { column, alone, smoothed: None })
            .collect();
        let scores = JointScores {
            joint: name.clone(),
            sample: Sample::Out,
            fused: fused.scores,
            smoothed: fused.smoothed,
            channels,
        };
        Ok((WrittenJoint { name, only: None, fusion: Some(path), channels: entries }, scores))
    }

    /// Returns the recordings of each channel. If the strain is known in holds only, all channels of a joint take the reference
    /// with the smallest mean variance.
    fn recordings(
        &self,
        args: &CalibrateArgs,
        tables: &[Table],
        messages: &Messages,
    ) -> Result<Vec<Vec<TraceFile>>, CliError> {
        let mut recordings = Vec::new();
        for channel in &self.channels {
            let mut traces = self.traces(args, tables, channel)?;
            let marked = marks::of_recordings(&mut traces, &[], None)?;
            let name = format!("channel `{}`", channel.column);
            for remark in marks::take(&mut traces, &marked).map_err(|error| error.named(&name))? {
                messages.remark(&format!("{name}: {remark}"));
            }
            recordings.push(traces);
        }
        for place in 0..tables.len() {
            let references =
                recordings.iter().filter_map(|traces: &Vec<TraceFile>| traces[place].trace.reference.as_ref());
            let found = references.filter_map(|reference| Some((mean_variance(&reference.sd)?, reference)));
            let best = found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, reference)| reference.clone());
            for traces in recordings.iter_mut().filter(|_| best.is_some()) {
                traces[place].trace.reference.clone_from(&best);
            }
        }
        Ok(recordings)
    }

    /// Returns the recordings of a channel, restricted to the rows of the calibration.
    fn traces(&self, args: &CalibrateArgs, tables: &[Table], channel: &Channel) -> Result<Vec<TraceFile>, CliError> {
        let overrides = args.units.metadata();
        let rows = |table: &Table| {
            let mut trace = table.trace(channel, &overrides)?;
            // Readings of a hand are not converted to one temperature, here as in use.
            trace.trace.temperature_c = None;
            Ok(trace.rows(rows_in(args, &trace)?))
        };
        tables.iter().map(rows).collect()
    }
}

/// Returns the mean square of the known deviations; `None` if none is known.
fn mean_variance(sd: &[f64]) -> Option<f64> {
    let (count, sum) = sd.iter().filter(|sd| sd.is_finite()).fold((0.0, 0.0), |(n, sum), sd| (n + 1.0, sum + sd * sd));
    (count > 0.0).then(|| sum / count)
}

/// Fuses the channels of a joint; `recordings` are those of each channel.
fn fused(recordings: &[Vec<TraceFile>], calibrated: &[Calibrated]) -> Result<Fused, CliError> {
    let mut known: Vec<Vec<Recording>> = Vec::new();
    for traces in recordings {
        let samples: Vec<Samples> = traces.iter().map(TraceFile::samples).collect::<Result<_, _>>()?;
        check_alike(traces)?;
        known.push(known_recordings(traces, &samples)?);
    }
    let pairs: Vec<(&Calibrated, &[Recording])> =
        calibrated.iter().zip(&known).map(|(calibrated, known)| (calibrated, known.as_slice())).collect();
    Ok(fuse(&pairs)?)
}
