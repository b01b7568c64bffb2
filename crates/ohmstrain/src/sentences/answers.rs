//! Doubts with their answers: flags and lines of a file on the command line, arguments in Python.

#[cfg(feature = "calibrate")]
use ohmstrain_calib::Lag;

use super::number::significant;
#[cfg(feature = "calibrate")]
use crate::{CalibrationDoubt, LagDoubt};
use crate::{Quiet, ReferenceDoubt, StartDoubt, UnitDoubt, UnitGuess, UnusedKnown, UseDoubt};

/// Interface through which a sensor is used and doubts are answered.
///
/// ```
/// let quiet = ohmstrain::Quiet { from_s: 12.0, now_s: 42.1, strain: 0.031 };
/// assert!(quiet.text(ohmstrain::Interface::CommandLine).ends_with(", add --known 42.1:0"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Command line, answered by flags.
    CommandLine,
    /// Python, answered by arguments.
    Python,
}

impl Interface {
    const fn of<'a>(self, by_flag: &'a str, by_argument: &'a str) -> &'a str {
        match self {
            Self::CommandLine => by_flag,
            Self::Python => by_argument,
        }
    }
}

impl UnitDoubt {
    /// Returns the doubt and its answer.
    ///
    /// ```
    /// fn warn(doubt: &ohmstrain::UnitDoubt) {
    ///     eprintln!("{}", doubt.text(ohmstrain::Interface::CommandLine));
    /// }
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        let answer = match self.guess {
            UnitGuess::KiloOhm => at.of(
                "Then say so with `--unit resistance=kohm` or a line `# resistance_unit = kohm` above the header",
                "Then say so with resistance_unit=\"kohm\"",
            ),
            UnitGuess::CalibrationInKiloOhm => at.of(
                "Then calibrate again with `--unit resistance=kohm`",
                "Then calibrate again with resistance_unit=\"kohm\"",
            ),
            UnitGuess::Percent => "The column is a ratio: 110 % is 1.1",
            UnitGuess::Ohm => "Divide them by what the rested sensor reads",
            UnitGuess::Ratio => "The sensor was calibrated in ohms",
            UnitGuess::MegaOhm => "The column is in ohms",
        };
        format!("{self} {answer}")
    }
}

impl ReferenceDoubt {
    /// Returns the doubt and its answer.
    ///
    /// ```
    /// let doubt = ohmstrain::ReferenceDoubt { expected: 0.3, found: 30.0, is_of_calibration: false };
    /// let text = doubt.text(ohmstrain::Interface::Python);
    /// assert!(text.ends_with("are they in percent? Then say so with strain_unit=\"percent\""));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        let answer = if self.is_of_calibration {
            "10 % is 0.1; calibrate again"
        } else {
            at.of(
                "Then say so with `--unit strain=percent` or a line `# strain_unit = percent` above the header",
                "Then say so with strain_unit=\"percent\"",
            )
        };
        format!("{self} {answer}")
    }
}

impl StartDoubt {
    /// Returns the doubt, after the name of the option.
    ///
    /// ```
    /// let doubt = ohmstrain::StartDoubt { found: 0.35, lower: 0.0, upper: 0.33 };
    /// assert!(doubt.text(ohmstrain::Interface::CommandLine).starts_with("--initial-strain: 0.35 is outside"));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        format!("{}: {self}", at.of("--initial-strain", "initial_strain"))
    }
}

impl UnusedKnown {
    /// Returns the doubt, after the known strain.
    ///
    /// ```
    /// let doubt = ohmstrain::UnusedKnown { known: ohmstrain::Known::new(70.0, 0.1), first_s: 0.0, last_s: 60.0 };
    /// assert!(doubt.text(ohmstrain::Interface::Python).starts_with("known: (70, 0.1) was not used"));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        let (time_s, strain) = (self.known.time_s, self.known.strain);
        match at {
            Interface::CommandLine => format!("--known {time_s}:{strain} {self}"),
            Interface::Python => format!("known: ({time_s}, {strain}) {self}"),
        }
    }
}

impl UseDoubt {
    /// Returns the doubt, with its answer if there is one.
    ///
    /// ```
    /// let doubt = ohmstrain::UseDoubt::FarTemperatures { count: 3 };
    /// assert!(doubt.text(ohmstrain::Interface::Python).starts_with("3 temperatures far from those of the calibration"));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        match *self {
            Self::Milliseconds { step_s, usual_s } => {
                let (step, usual) = (significant(step_s, 3), significant(usual_s, 3));
                let answer = at.of(
                    "convert the recording with `ohmstrain import FILE --unit time=ms -o trace.csv`",
                    "divide it by 1000, or read the file with read(FILE, units={\"time\": \"ms\"})",
                );
                format!(
                    "rows are {step} s apart, {usual} s in the calibration: if `time_s` is in milliseconds, {answer}"
                )
            }
            Self::NoTemperatures { lower_c, upper_c } => format!(
                "no column `temperature_c`: intervals are wider by what {} to {} °C do to the strain, as in the calibration",
                significant(lower_c, 3),
                significant(upper_c, 3)
            ),
            Self::FarTemperatures { count } => {
                let plural = if count == 1 { "" } else { "s" };
                format!(
                    "{count} temperature{plural} far from those of the calibration counted as missing: is the probe connected?"
                )
            }
        }
    }
}

impl Quiet {
    /// Returns the question and its answer.
    ///
    /// ```
    /// let quiet = ohmstrain::Quiet { from_s: 12.0, now_s: 42.1, strain: 0.031 };
    /// assert!(quiet.text(ohmstrain::Interface::Python).ends_with(", add known=[(42.1, 0)]"));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        match at {
            Interface::CommandLine => format!("{self}, add --known {}:0", self.now_s),
            Interface::Python => format!("{self}, add known=[({}, 0)]", self.now_s),
        }
    }
}

#[cfg(feature = "calibrate")]
impl CalibrationDoubt {
    /// Returns the doubt and its answer.
    ///
    /// ```
    /// let doubt = ohmstrain::CalibrationDoubt::TurnedApart { recordings: [1, 0] };
    /// assert!(doubt.text(ohmstrain::Interface::Python).ends_with(" Change it"));
    /// ```
    #[must_use]
    pub fn text(&self, at: Interface) -> String {
        let answer = match self {
            Self::Percent { .. } => at.of(
                "; if they are in percent, say so with `--unit strain=percent` or a line `# strain_unit = percent` above the \
                 header, if not with `fraction`",
                "; if they are in percent, say so with strain_unit=\"percent\", if not with strain_unit=\"fraction\"",
            ),
            Self::KiloOhm { .. } => at.of(
                "; if they are in kilo-ohms, say so with `--unit resistance=kohm` or a line `# resistance_unit = kohm` above \
                 the header, if not with `ohm`",
                "; if they are in kilo-ohms, say so with resistance_unit=\"kohm\", if not with resistance_unit=\"ohm\"",
            ),
            Self::ReadingsApart { .. } => {
                at.of(" Then put `# resistance_unit = kohm` above its header", " Then multiply its column by 1000")
            }
            Self::ReferencesApart { .. } => {
                at.of(" Then put `# strain_unit = percent` above its header", " Then divide its column by 100")
            }
            Self::Exchanged { .. } => at.of(
                "; if they are, exchange their names in the header",
                "; if they are, exchange the names of the columns",
            ),
            Self::Frozen { .. } => at.of(
                "; leave that part out with `--from` and `--until`, or empty those cells of the reference",
                "; leave that part out, or put NaN in its reference",
            ),
            Self::Turned { .. } => at.of(
                "; if it has, change it, if not say so with `--unit strain=fraction` or a line `# strain_unit = fraction` above \
                 the header",
                "; if it has, change it, if not say so with strain_unit=\"fraction\"",
            ),
            Self::TurnedApart { .. } => " Change it",
            Self::Milliseconds { .. } => at.of(
                "; if they are, divide them by 1000, if not say so with a line `# time_unit = s` above the header",
                "; divide them by 1000",
            ),
            Self::Temperature { .. } => at.of(
                "; or give the coefficients with --temperature",
                "; or give the coefficients with `temperature=`",
            ),
            Self::Widened { .. } => at.of(" (--explain)", ""),
            Self::GaugesApart { .. } | Self::Copy { .. } | Self::RestsApart { .. } => "",
        };
        format!("{self}{answer}")
    }
}

/// Decision about a reference that does not have the clock of the readings, with its sentence; see [`LagDoubt::answer`].
///
/// ```
/// use ohmstrain::{Interface, LagAnswer, LagDoubt};
///
/// let doubt = LagDoubt::OutOfReach { lag_s: -12.0 };
/// assert!(matches!(doubt.answer(true, Interface::Python), LagAnswer::Warn(_)));
/// ```
#[cfg(feature = "calibrate")]
#[derive(Clone, Debug, PartialEq)]
pub enum LagAnswer {
    /// The reference is moved, as requested.
    Move(Lag, String),
    /// The reference is not used for calibration.
    Refuse(String),
    /// The reference stays, which may be wrong.
    Warn(String),
    /// The reference stays, which is right.
    Remark(String),
}

#[cfg(feature = "calibrate")]
impl LagDoubt {
    /// Returns the decision about the reference; `align` is true if it is to be moved if possible.
    ///
    /// ```
    /// use ohmstrain::{Interface, LagAnswer, LagDoubt};
    ///
    /// let doubt = LagDoubt::Repeats { lags_s: [2.0, -3.0] };
    /// assert!(matches!(doubt.answer(false, Interface::CommandLine), LagAnswer::Warn(_)));
    /// ```
    #[must_use]
    pub fn answer(&self, align: bool, at: Interface) -> LagAnswer {
        let by = at.of("--align", "align=True");
        match self {
            Self::Little(lag) | Self::Uncertain(lag) | Self::Certain(lag) if align => {
                LagAnswer::Move(*lag, format!("the reference is {lag}; it was moved by that"))
            }
            Self::OutOfReach { .. } | Self::Repeats { .. } => LagAnswer::Warn(self.to_string()),
            Self::Little(_) => LagAnswer::Remark(self.to_string()),
            Self::Uncertain(_) => LagAnswer::Warn(format!("{self} {by} moves it")),
            Self::Certain(_) => {
                LagAnswer::Refuse(format!("{self}; {by} moves it to where the readings say it belongs"))
            }
        }
    }
}
