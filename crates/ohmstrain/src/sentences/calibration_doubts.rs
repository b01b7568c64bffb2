//! Sentences for doubts about the recordings of a calibration.

use std::fmt;

use ohmstrain_sensor::LARGEST_SD_SCALE;

use super::number::{plain, significant};
use crate::{CalibrationDoubt, LagDoubt};

impl fmt::Display for CalibrationDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Exchanged { readings, reference, .. } => write!(
                out,
                "the columns `{readings}` and `{reference}` seem to be exchanged: expected readings that stay well above zero \
                 and a reference that does not, found the reverse"
            ),
            Self::Percent { largest, gauge, .. } => write!(
                out,
                "expected the reference as a fraction of the length, found strains of up to {}, over which the readings \
                 change by {gauge:.3} of their median per strain",
                plain(*largest)
            ),
            Self::KiloOhm { median, .. } => {
                write!(out, "column `resistance_ohm`: expected ohms, found readings of about {}", plain(*median))
            }
            Self::ReadingsApart { medians: [least, most], .. } => write!(
                out,
                "readings of about {} and {}, {:.0} times as much; expected one sensor in one unit; is one of them in kilo-ohms?",
                plain(*least),
                plain(*most),
                most / least
            ),
            Self::ReferencesApart { gauges: [least, most], .. } => write!(
                out,
                "the readings change by {least:.3} and {most:.3} of their median per unit of the reference, {:.0} times as \
                 much; expected one sensor and one unit; is the reference of the first in percent?",
                most / least
            ),
            Self::GaugesApart { gauges: [least, most], .. } => write!(
                out,
                "the readings change by {least:.3} and {most:.3} of their median per unit of the reference: one sensor?"
            ),
            Self::Frozen { from_s, to_s, reference, swing, .. } => write!(
                out,
                "expected a reference that moves with the readings, found {} from {} to {} s, while they go up and down by {}: is it \
                 frozen?",
                plain(*reference),
                plain(*from_s),
                plain(*to_s),
                significant(*swing, 2)
            ),
            Self::Turned { lower, upper, .. } => write!(
                out,
                "expected strains of a sensor that stretches, above zero, found {} to {}: has the reference the other sign?",
                significant(*lower, 2),
                significant(*upper, 2)
            ),
            Self::TurnedApart { .. } => out.write_str(
                "the readings of the first go against its reference, those of the second with it; expected one sensor: has one of \
                 the references the other sign?",
            ),
            Self::Milliseconds { step, stroke_s, .. } => write!(
                out,
                "column `time_s`: expected seconds, found whole numbers {} apart, by which a stroke takes {} s: are they milliseconds?",
                plain(*step),
                significant(*stroke_s, 2)
            ),
            Self::Copy { .. } => out.write_str("the same rows: they count twice"),
            Self::RestsApart { rests: [least, most], .. } => write!(
                out,
                "R0 comes out as {} and {}, {:.0} % more: one sensor?",
                significant(*least, 5),
                significant(*most, 5),
                100.0 * (most / least - 1.0)
            ),
            Self::Temperature { range_k, rest_per_k: (value, sd) } => write!(
                out,
                "the temperature moves by {} K, but together with relaxation, drift or strain: its effect on R0, {} ± {} % per K, is \
                 not certain and not removed; record rises and falls of the temperature while the sensor moves as usual",
                significant(*range_k, 2),
                significant(100.0 * value, 2),
                significant(100.0 * sd, 1)
            ),
            Self::Widened { of } => write!(
                out,
                "the {of}'s intervals are widened by {LARGEST_SD_SCALE}, the maximum: on held-out parts of the recordings the law errs by more than \
                 they state; another recording, or other branches, may help"
            ),
        }
    }
}

/// A time by which the reference is late, s.
struct Late(f64);

impl fmt::Display for Late {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{:.2} s {}", self.0.abs(), if self.0 < 0.0 { "early" } else { "late" })
    }
}

impl fmt::Display for LagDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::OutOfReach { lag_s } => write!(
                out,
                "the reference seems to be {} or more, as far as lags are looked for; it was not moved: are both on one clock?",
                Late(*lag_s)
            ),
            Self::Repeats { lags_s: [best_s, other_s] } => write!(
                out,
                "the reference seems to be {} or {}, which fit alike since the motion repeats; it was not moved: are both on one \
                 clock?",
                Late(*best_s),
                Late(*other_s)
            ),
            Self::Little(lag) => {
                write!(out, "the reference seems to be {lag}, little of the {:.1} s of a movement", lag.movement_s)
            }
            Self::Uncertain(lag) => write!(
                out,
                "the reference seems to be {lag}, where a movement takes {:.1} s; the readings do not tell for certain, and it was \
                 not moved: are both on one clock?",
                lag.movement_s
            ),
            Self::Certain(lag) => write!(
                out,
                "expected a reference on the clock of the readings, found one that seems to be {lag}, where a movement takes {:.1} s",
                lag.movement_s
            ),
        }
    }
}
