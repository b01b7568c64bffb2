//! A hand of several joints as C: a filter for each channel, and the fusion of channels that see one joint.

mod constants;
mod fused;
mod process;
mod twin;

use ohmstrain_sensor::fusion::FusionParams;
use ohmstrain_sensor::{JointParams, Quantity, SensorParams};

use crate::{ExportError, ExportTarget, Plan, Prefix, Promise, SourceFile, files, filled};
use constants::HandConstants;

/// A joint with its channels.
#[derive(Clone, Debug)]
pub struct HandJoint<'a> {
    /// Its name.
    pub name: String,
    /// Channels that see it, at least one.
    pub channels: Vec<HandChannel<'a>>,
    /// Fusion of several channels.
    pub fusion: Option<&'a FusionParams>,
    /// The joint that the sensors span, if they were calibrated on strain and an angle is wanted.
    pub joint: Option<JointParams>,
}

/// A column of readings with its sensor.
#[derive(Clone, Debug)]
pub struct HandChannel<'a> {
    /// Name of the column.
    pub column: String,
    /// The sensor.
    pub params: &'a SensorParams,
    /// Today's reading of the rested sensor.
    pub rest_resistance: Option<f64>,
    /// Its divider, for the sketch.
    pub divider: Option<Divider>,
}

/// A divider of a sensor and a known resistor, and its converter.
#[derive(Clone, Copy, Debug)]
pub struct Divider {
    /// The known resistor, Ω.
    pub reference_ohm: f64,
    /// True if the sensor lies between the supply and the pin, false if between the pin and ground.
    pub is_high: bool,
    /// Largest code.
    pub full: f64,
}

impl HandJoint<'_> {
    /// True if an angle is reported.
    fn is_angle(&self) -> bool {
        self.joint.is_some() || self.channels.iter().any(|channel| channel.params.quantity == Quantity::AngleDeg)
    }
}

/// Source code of a hand, and what it costs.
#[derive(Clone, Debug)]
pub struct HandFirmware {
    /// Its files.
    pub files: Vec<SourceFile>,
    /// Costs, line by line.
    pub costs: Vec<String>,
}

/// Name in the exported folder, and template.
const TEMPLATES: [(&str, &str); 10] = [
    ("src/ohmstrain.h", include_str!("../templates/hand/hand.h")),
    ("src/ohmstrain.c", include_str!("../templates/hand/hand.c")),
    ("examples/ohmstrain_plotter/ohmstrain_plotter.ino", include_str!("../templates/hand/plotter.ino")),
    ("library.properties", include_str!("../templates/hand/library.properties")),
    ("library.json", include_str!("../templates/hand/library.json")),
    ("selftest/vectors.h", include_str!("../templates/hand/vectors.h")),
    ("selftest/selftest.c", include_str!("../templates/hand/selftest.c")),
    ("selftest/replay.c", include_str!("../templates/hand/replay.c")),
    ("CMakeLists.txt", include_str!("../templates/CMakeLists.txt")),
    ("README.md", include_str!("../templates/hand/readme.md")),
];

impl HandFirmware {
    /// Exports all joints of a hand, each channel with the default estimator of its sensor, for readings every `dt_s` seconds.
    ///
    /// # Errors
    /// See [`ExportError`]; also if two joints or two channels have the same name in C.
    pub fn new(joints: &[HandJoint], dt_s: f64, prefix: &Prefix) -> Result<Self, ExportError> {
        let plan = Plan::default();
        let hand = HandConstants::new(joints, &plan, dt_s)?;
        let mut exported = Vec::new();
        for (name, channel) in hand.channel_names().zip(joints.iter().flat_map(|joint| &joint.channels)) {
            let of_column =
                |error: ExportError| ExportError::Parameter(format!("column `{}`: {error}", channel.column));
            let promise = Promise::new(channel.params, &plan, dt_s, None, None).map_err(of_column)?;
            let part = prefix.of_part(name);
            let all = files(channel.params, &plan, ExportTarget::C, dt_s, &part, &promise.lines).map_err(of_column)?;
            exported.extend(all.into_iter().filter(|file| file.path.starts_with("src/")));
        }
        exported.extend(filled(&TEMPLATES, &hand, prefix)?);
        Ok(Self { files: exported, costs: hand.costs })
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_model::StrainRange;
    use ohmstrain_sensor::Quantity;
    use ohmstrain_sensor::fusion::{FUSION_FORMAT, FusionErrors, FusionParams, FusionRow, RegressionParams};

    /// Returns a fusion of three channels with curves of their own, one of which sees the rate.
    pub(super) fn fusion() -> FusionParams {
        let row = |k: usize| {
            let t = 0.1 * k as f64;
            let strain = 0.15 - 0.10 * (0.9 * t).cos() - 0.05 * (0.33 * t + 1.0).cos();
            let rate = 0.09 * (0.9 * t).sin() + 0.0165 * (0.33 * t + 1.0).sin();
            let ln_r = vec![2.0 * strain + 0.3 * rate, 3.0 * strain - 2.0 * strain * strain, 1.5 * strain - 0.2 * rate];
            let low_passed = vec![ln_r.iter().map(|value| value - 0.5 * rate).collect()];
            FusionRow { strain, ln_r, low_passed }
        };
        let errors = |members: usize| FusionErrors {
            sd_scale: 1.2,
            covariance: (0..members).map(|i| (0..members).map(|j| if i == j { 1.0 } else { 0.3 }).collect()).collect(),
        };
        FusionParams {
            format: FUSION_FORMAT,
            made_by: "a test".into(),
            novelty: 3.0,
            channel_sd: vec![0.02; 3],
            low_pass_s: vec![1.0],
            quantity: Quantity::Strain,
            limits: StrainRange { lower: 0.0, upper: 0.3 },
            errors: errors(4),
            filters: Some(errors(3)),
            smoothers: None,
            regressions: vec![RegressionParams { low_passes: vec![0], length: 2.0, noise: 0.02 }],
            rows: (0..160).map(row).collect(),
        }
    }
}
