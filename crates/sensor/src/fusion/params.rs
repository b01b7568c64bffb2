use nalgebra::DMatrix;
use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

use crate::params::Quantity;
use crate::params::validate::FieldError;
use crate::params::validate::table::{Allowed, FACTOR, POSITIVE, SIGNED, Table};

/// Version of the fusion file this code reads and writes.
pub const FUSION_FORMAT: u32 = 2;
/// Maximum number of channels of one strain.
pub const MOST_CHANNELS: usize = 32;
const COVARIANCE: Allowed = Allowed { least: -1e9, most: 1e9 };
/// Noise of a regression: without noise, repeated rows make its matrix singular.
const NOISE: Allowed = Allowed { least: 1e-4, most: 1.0 };

/// Fusion of several channels of one strain: the content of a fusion file.
///
/// Its members are the channels' filters, or their smoothers, in order, and then the regressions of the strain on all readings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FusionParams {
    /// Version of the format, [`FUSION_FORMAT`].
    pub format: u32,
    /// Program and version that made it.
    pub made_by: String,
    /// 99th percentile, over rows of held-out blocks, of the squared distance per channel from the calibration's readings.
    pub novelty: f64,
    /// Typical difference of ln R of each channel between rows in which the others agree.
    pub channel_sd: Vec<f64>,
    /// Time constants of the low-passes of ln R, s.
    pub low_pass_s: Vec<f64>,
    /// The estimated quantity.
    pub quantity: Quantity,
    /// Range of the output.
    pub limits: StrainRange<f64>,
    /// Errors of the channels' filters and of the regressions.
    pub errors: FusionErrors,
    /// Errors of the channels' filters alone, for a microcontroller; `None` if nothing was held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filters: Option<FusionErrors>,
    /// Errors of the channels' smoothers and of the regressions; `None` if nothing was held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smoothers: Option<FusionErrors>,
    /// Regressions of the strain on all channels' readings.
    pub regressions: Vec<RegressionParams>,
    /// Rows of the calibration.
    pub rows: Vec<FusionRow>,
}

/// Errors of the members of a fusion on held-out blocks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FusionErrors {
    /// Factor on the fused standard deviation.
    pub sd_scale: f64,
    /// Covariances of the errors, in units of the members' standard deviations, with shrunken correlations; no variance is below one.
    pub covariance: Vec<Vec<f64>>,
}

/// Parameters of a Gaussian process of the strain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegressionParams {
    /// Indices into [`FusionParams::low_pass_s`]: inputs are ln R of each channel and its difference from these low-passes.
    pub low_passes: Vec<usize>,
    /// Length scale of all inputs, in standard deviations of the input.
    pub length: f64,
    /// Standard deviation of the noise, as a share of the range of the strain.
    pub noise: f64,
}

/// A row of the calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FusionRow {
    /// True strain.
    pub strain: f64,
    /// ln R/R₀ of each channel.
    pub ln_r: Vec<f64>,
    /// Low-passes of ln R/R₀: one list of channels for each time constant.
    pub low_passed: Vec<Vec<f64>>,
}

impl FusionParams {
    /// Number of channels.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channel_sd.len()
    }

    /// Number of members: channels and regressions.
    #[must_use]
    pub const fn members(&self) -> usize {
        self.channels() + self.regressions.len()
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number outside its range, or a list whose length does not match the number of channels.
    pub fn validate(&self) -> Result<(), FieldError> {
        let root = Table::root();
        root.range("limits", self.limits)?;
        root.number("novelty", self.novelty, POSITIVE)?;
        root.numbers("channel_sd", &self.channel_sd, POSITIVE)?;
        if !(2..=MOST_CHANNELS).contains(&self.channels()) {
            return Err(root.wrong("channel_sd", format!("2 to {MOST_CHANNELS} entries"), self.channels()));
        }
        if self.rows.is_empty() {
            return Err(root.wrong("rows", "at least one", 0));
        }
        root.numbers("low_pass_s", &self.low_pass_s, POSITIVE)?;
        if self.low_pass_s.is_empty() {
            return Err(root.wrong("low_pass_s", "at least one", 0));
        }
        self.errors.validate(&root.table("errors"), self.members())?;
        self.filters.iter().try_for_each(|errors| errors.validate(&root.table("filters"), self.channels()))?;
        self.smoothers.iter().try_for_each(|errors| errors.validate(&root.table("smoothers"), self.members()))?;
        for (index, regression) in self.regressions.iter().enumerate() {
            regression.validate(&root.entry("regressions", index), self.low_pass_s.len())?;
        }
        self.rows.iter().enumerate().try_for_each(|(index, row)| self.check_row(&root.entry("rows", index), row))
    }

    fn check_row(&self, table: &Table, row: &FusionRow) -> Result<(), FieldError> {
        table.number("strain", row.strain, SIGNED)?;
        table.length("ln_r", self.channels(), row.ln_r.len())?;
        table.numbers("ln_r", &row.ln_r, SIGNED)?;
        table.length("low_passed", self.low_pass_s.len(), row.low_passed.len())?;
        row.low_passed.iter().try_for_each(|of_channels| {
            table.length("low_passed", self.channels(), of_channels.len())?;
            table.numbers("low_passed", of_channels, SIGNED)
        })
    }
}

impl FusionErrors {
    fn validate(&self, table: &Table, members: usize) -> Result<(), FieldError> {
        table.number("sd_scale", self.sd_scale, FACTOR)?;
        table.length("covariance", members, self.covariance.len())?;
        self.covariance.iter().try_for_each(|of_member| {
            table.length("covariance", members, of_member.len())?;
            table.numbers("covariance", of_member, COVARIANCE)
        })?;
        let matrix = DMatrix::from_fn(members, members, |i, j| self.covariance[i][j]);
        if matrix == matrix.transpose() && matrix.cholesky().is_some() {
            return Ok(());
        }
        Err(table.wrong("covariance", "a symmetric, positive definite matrix", "another one"))
    }
}

impl RegressionParams {
    fn validate(&self, table: &Table, low_passes: usize) -> Result<(), FieldError> {
        table.number("length", self.length, POSITIVE)?;
        table.number("noise", self.noise, NOISE)?;
        match self.low_passes.iter().find(|index| **index >= low_passes) {
            Some(index) => Err(table.wrong("low_passes", format!("less than {low_passes}"), index)),
            None => Ok(()),
        }
    }
}
