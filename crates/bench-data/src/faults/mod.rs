//! Recordings of failing sensors, wires, converters and clocks. A fault starts at a given time of a recording; the reference keeps the true
//! strain.
//!
//! A fault is a kind with its severity; an [`Episode`] adds its start, its end, and a seed. Readings are changed in place; an episode of a
//! clock changes times, or duplicates or moves rows together with their reference.
//!
//! ```
//! use ohmstrain_bench_data::faults::{Episode, Fault};
//! use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
//!
//! let trace = simulate(&SimulationSettings::new(Material::Ecoflex0030, Protocol::EXTEND_RETRACT))?;
//! let unplugged = Episode { fault: Fault::UnpluggedHigh { reading: 1e9 }, from_s: 10.0, until_s: 12.0, seed: 1 };
//! let faulty = unplugged.put_into(&trace);
//! assert_eq!(faulty.readings.values.iter().filter(|ohm| **ohm == 1e9).count(), 40);
//! # Ok::<(), ohmstrain_bench_data::simulate::SettingsError>(())
//! ```

mod clock;
mod readings;

use crate::trace::Trace;

/// Kind and size of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// A fraction of the readings, at random, is missing.
    Dropout {
        /// 0 to 1.
        share: f64,
    },
    /// White noise is added.
    Burst {
        /// Its standard deviation, as a fraction of the smallest reading.
        sd: f64,
    },
    /// One reading is multiplied by a factor.
    Spike {
        /// The factor.
        factor: f64,
    },
    /// A fraction of the readings, at random, is multiplied by a factor.
    Spikes {
        /// 0 to 1.
        share: f64,
        /// The factor.
        factor: f64,
    },
    /// The last good reading is repeated.
    Stuck,
    /// Readings above a level are clipped to it.
    Saturation {
        /// The level, as a fraction of the range between the smallest and the largest reading.
        share: f64,
    },
    /// A wire is disconnected: readings are far too high.
    UnpluggedHigh {
        /// Value of the readings, in their unit.
        reading: f64,
    },
    /// A short circuit: readings are far too low.
    UnpluggedLow {
        /// Value of the readings, in their unit.
        reading: f64,
    },
    /// Contacts add a resistance.
    BaselineStep {
        /// The resistance, as a fraction of the smallest reading.
        share: f64,
    },
    /// The readings' change from the smallest one is multiplied by a factor.
    GainChange {
        /// The factor.
        factor: f64,
    },
    /// The readings' change from the smallest one has the wrong sign.
    PolarityFlip,
    /// Times are wrong, while readings are taken at the right ones; rows keep their order.
    Jitter {
        /// Standard deviation, as a fraction of a step.
        share: f64,
    },
    /// A fraction of the rows is duplicated, with the same time.
    Duplicated {
        /// 0 to 1.
        share: f64,
    },
    /// A fraction of the rows is swapped with the next one, so that time goes backwards.
    Late {
        /// 0 to 1.
        share: f64,
    },
    /// The sensor's resistance at rest is that of the calibration, multiplied by a factor.
    WrongRest {
        /// The factor.
        factor: f64,
    },
    /// The sensor has slipped: the body's strain exceeds the sensor's.
    Slipped {
        /// Offset, in the reference's unit.
        by: f64,
    },
    /// The clock is fast by a factor.
    WrongRate {
        /// The factor.
        factor: f64,
    },
}

impl Fault {
    /// Returns its name, without its severity.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Dropout { .. } => "dropout",
            Self::Burst { .. } => "burst",
            Self::Spike { .. } => "spike",
            Self::Spikes { .. } => "spikes",
            Self::Stuck => "stuck",
            Self::Saturation { .. } => "saturation",
            Self::UnpluggedHigh { .. } => "unplugged, high",
            Self::UnpluggedLow { .. } => "unplugged, low",
            Self::BaselineStep { .. } => "step in baseline",
            Self::GainChange { .. } => "gain change",
            Self::PolarityFlip => "polarity flip",
            Self::Jitter { .. } => "jitter",
            Self::Duplicated { .. } => "duplicated rows",
            Self::Late { .. } => "late rows",
            Self::WrongRest { .. } => "wrong R₀",
            Self::Slipped { .. } => "slipped sensor",
            Self::WrongRate { .. } => "wrong rate",
        }
    }
}

/// A fault with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// Kind and size of the fault.
    pub fault: Fault,
    /// Start, s.
    pub from_s: f64,
    /// End, s; infinite for a permanent fault.
    pub until_s: f64,
    /// Equal seeds give equal episodes.
    pub seed: u64,
}

impl Episode {
    /// Returns the recording with the fault in it; for some faults, its times repeat or go backwards.
    #[must_use]
    pub fn put_into(&self, trace: &Trace) -> Trace {
        let mut faulty = trace.clone();
        let first = trace.time_s.partition_point(|time_s| *time_s < self.from_s);
        let rows = first..trace.time_s.partition_point(|time_s| *time_s < self.until_s).max(first);
        match self.fault {
            Fault::Jitter { .. } | Fault::Duplicated { .. } | Fault::Late { .. } | Fault::WrongRate { .. } => {
                clock::put_into(&mut faulty, rows, self.fault, self.seed);
            }
            Fault::Slipped { by } => {
                if let Some(reference) = &mut faulty.reference {
                    reference.values[rows].iter_mut().for_each(|strain| *strain += by);
                }
            }
            fault => readings::put_into(&mut faulty.readings.values, rows, fault, self.seed),
        }
        faulty
    }
}
