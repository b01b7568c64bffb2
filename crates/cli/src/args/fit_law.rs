use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, ValueEnum};
use ohmstrain_calib::closed_form::{ClosedForm, ModulusShape};
use ohmstrain_model::Phase;

use super::{ReplaceArgs, RestResistance, UnitArgs};

/// Flags of `fit-law`.
#[derive(Clone, Debug, ClapArgs)]
#[command(after_long_help = LAWS)]
pub struct FitLawArgs {
    /// Recordings; with a reference, unless `--segment whole`
    #[arg(required = true)]
    pub traces: Vec<PathBuf>,
    /// The law: eq1, eq2, eq5:N, eq6, eq7:N, eq8, eq9, eq8+eq9, kww, prony:N or tunnelling
    #[arg(long, default_value = "eq8+eq9")]
    pub law: ClosedForm,
    /// Modulus in equations 8 and 9: single (one exponential, as printed), eq6 or eq7:N
    #[arg(long, value_name = "MODULUS")]
    pub modulus: Option<ModulusShape>,
    /// Segments to fit, separated by commas: extend, hold or retract, the N-th of them as in hold:2, or whole for the
    /// recording without a cut; by default all that the law is about
    #[arg(long, value_delimiter = ',')]
    pub segment: Vec<SegmentChoice>,
    /// Fit one set of parameters to all segments of a kind; movements at several speeds tell eta from r1
    #[arg(long)]
    pub pool: bool,
    /// Resistance at rest for eq2: a number in the readings' unit, or first:N for the median of the first N readings
    #[arg(long, value_name = "OHM|first:N", default_value = "first:20", allow_negative_numbers = true)]
    pub rest_resistance: RestResistance,
    /// Fit several laws of one phase to the same segments and rank them by AICc and BIC: eq1,eq2,kww,prony:3
    #[arg(long, value_name = "LAWS", value_delimiter = ',', conflicts_with_all = ["law", "table", "figures"])]
    pub compare: Vec<ClosedForm>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Form of tables; CSV has all digits, and a column of standard errors for each parameter
    #[arg(long, value_enum, default_value_t = TableFormat::Text, conflicts_with = "json")]
    pub format: TableFormat,
    /// Also write a plot of each fit as SVG, with what is drawn as CSV, to this folder
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print one row per material, speed and phase over all recordings
    #[arg(long, conflicts_with_all = ["json", "pool"])]
    pub table: bool,
    /// Units of the recordings' columns
    #[command(flatten)]
    pub units: UnitArgs,
}

/// A form of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// For a terminal.
    Text,
    /// For another program.
    Csv,
    /// For a paper: a tabular with booktabs.
    Latex,
}

/// Text of the long help after the flags.
const LAWS: &str = "\
Laws, t the time since the segment began:
  of a hold
  eq1         R = r_inf + r1 exp(-lambda1 t) + r2 exp(-lambda2 t)
  eq2         R/R0 - 1 = a + b exp(-t/tau) + c t
  eq5:N       R = sum a_i exp(-t/tau_i)
  eq6         R = scale (exp(-t/tau) + e0)
  eq7:N       R = e_inf + sum e_i exp(-t/tau_i); prony:N is the same
  eq9         R = r0_hold r_start exp(-t/tau0) + r1_hold, r1_hold = r_start (1 - r0_hold)
  kww         R = r_inf + r exp(-(t/tau)^beta)
  of a movement, extend or retract
  eq8         R = r0 exp(-t/tau0) v t + v eta + r1; v t is the measured travel
  tunnelling  R = rest_reading (1 + gap x) exp(barrier x + path_loss x^2), x the strain
  of both
  eq8+eq9     a movement and the hold after it, with one tau0, without a jump

At one speed v eta and r1 cannot be told apart and are one parameter. A parameter that the \
readings do not tell has no standard error. Standard errors take the residuals for white; the \
column `neighbours` is the correlation of neighbouring residuals: near 1 the errors are several \
times too small. A hold before the first movement is fitted only if it is asked for.

--table: a row is the mean over the segments of that material, speed (within 10 %) and phase. \
With two or more, ± is the standard error from their scatter. A movement without a hold after it \
is fitted by eq8 alone. R^2 is that of the phase, the smallest of the row's segments. `rest` is a \
hold after a release.";

/// Choice of segments to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentChoice {
    /// The recording without a cut.
    Whole,
    /// Segments of a phase, or the one with a number, from 1.
    Phase(Phase, Option<usize>),
}

/// Name of a phase in segments.
pub const fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Extend => "extend",
        Phase::Hold => "hold",
        Phase::Retract => "retract",
    }
}

impl FromStr for SegmentChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || "expected extend, hold, retract, one of them with a number such as hold:2, or whole".to_string();
        if text == "whole" {
            return Ok(Self::Whole);
        }
        let (name, number) = match text.split_once(':') {
            None => (text, None),
            Some((name, number)) => {
                (name, Some(number.parse().ok().filter(|number| *number > 0).ok_or_else(expected)?))
            }
        };
        let phase = Phase::ALL.into_iter().find(|phase| phase_name(*phase) == name).ok_or_else(expected)?;
        Ok(Self::Phase(phase, number))
    }
}

impl fmt::Display for SegmentChoice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => out.write_str("whole"),
            Self::Phase(phase, None) => out.write_str(phase_name(*phase)),
            Self::Phase(phase, Some(number)) => write!(out, "{}:{number}", phase_name(*phase)),
        }
    }
}
