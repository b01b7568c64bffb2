//! Sentences for doubts, as questions to the user.

use std::fmt;

use super::number::{plain, significant};
use crate::{Beyond, Extrapolation, Quiet, ReferenceDoubt, StartDoubt, UnitDoubt, UnitGuess, UnusedKnown};

impl fmt::Display for UnitDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { column, expected: (low, high), median, guess, .. } = self;
        let (low, high, median) = (significant(*low, 5), significant(*high, 5), significant(*median, 5));
        write!(out, "column `{column}`: expected readings of {low} to {high}, as in the calibration")?;
        self.rest_reading.map_or(Ok(()), |rest| write!(out, " with R0 = {}", significant(rest, 5)))?;
        write!(out, ", found {median} at the median, {guess}")
    }
}

impl fmt::Display for UnitGuess {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(match self {
            Self::KiloOhm => "a thousandth of that: are they in kilo-ohms?",
            Self::MegaOhm => "a millionth of that: are they in mega-ohms?",
            Self::CalibrationInKiloOhm => "a thousand times that: is the calibration in kilo-ohms?",
            Self::Ratio => "near one: are they ratios to some resistance at rest?",
            Self::Percent => "a hundred times that: are they in percent?",
            Self::Ohm => "no such ratio: are they in ohms?",
        })
    }
}

impl fmt::Display for ReferenceDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { expected, found, is_of_calibration } = self;
        let question = if *is_of_calibration { "was the calibration in percent?" } else { "are they in percent?" };
        let (expected, found) = (plain(*expected), plain(*found));
        write!(
            out,
            "column `strain`: expected strains of up to {expected}, as in the calibration, found {found}: {question}"
        )
    }
}

impl fmt::Display for StartDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { found, lower, upper } = *self;
        let (lower, upper) = (plain(lower), plain(upper));
        write!(out, "{found} is outside of the sensor's limits, {lower} to {upper}; what is reported stops there")
    }
}

impl fmt::Display for UnusedKnown {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (first, last) = (significant(self.first_s, 6), significant(self.last_s, 6));
        write!(out, "was not used: the recording goes from {first} to {last} s")
    }
}

impl fmt::Display for Quiet {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { from_s, now_s, strain } = *self;
        write!(
            out,
            "{} s of quiet readings from t = {} s, which may be a rest; estimated strain {}: if the body was at rest",
            significant(now_s - from_s, 2),
            significant(from_s, 6),
            significant(strain, 2)
        )
    }
}

impl fmt::Display for Extrapolation {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "at {} s: ", significant(self.time_s, 6))?;
        match self.beyond {
            Beyond::Duration { longest_s } => {
                write!(out, "longer than the {longest_s:.1} s of the calibration, in which readings drifted")
            }
            Beyond::Rate { quantity, fastest_per_s } => {
                let quantity = quantity.name();
                write!(out, "{quantity} changes faster than the calibration's {fastest_per_s:.4} per second")
            }
            Beyond::Readings { column, least, most, follows } => {
                let (least, most) = (significant(least, 5), significant(most, 5));
                let rest = if follows { "; R0 adapts, but today's resistance at rest is better given" } else { "" };
                write!(out, "{column} is outside of the calibration's {least} to {most}{rest}")
            }
            Beyond::Strain { quantity, least, most } => {
                let quantity = quantity.name();
                write!(out, "{quantity} is outside of the calibration's {least:.4} to {most:.4}")
            }
        }?;
        out.write_str("; estimates are extrapolations")
    }
}
