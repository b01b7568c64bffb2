//! Recordings of sensors, wires, converters and clocks that fail: a fault is put into a recording from a time on, and the
//! reference keeps the true strain.
//!
//! A fault is a kind with its severity; an [`Episode`] adds when it begins, when it ends, and a seed. Readings are changed in
//! place; an episode of a clock changes times, or adds or moves rows together with their reference.
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
    /// Readings are missing: this share of them, at random.
    Dropout {
        /// 0 to 1.
        share: f64,
    },
    /// White noise is added.
    Burst {
        /// Its standard deviation, a share of the least reading.
        sd: f64,
    },
    /// One reading is so many times what it should be.
    Spike {
        /// The factor.
        factor: f64,
    },
    /// A share of the readings is, at random.
    Spikes {
        /// 0 to 1.
        share: f64,
        /// The factor.
        factor: f64,
    },
    /// The last good reading comes again and again.
    Stuck,
    /// Readings above a level stand at that level.
    Saturation {
        /// The level, a share of the range between the least and the largest reading.
        share: f64,
    },
    /// A wire is off: readings far too high.
    UnpluggedHigh {
        /// Value that is read then, in the readings' unit.
        reading: f64,
    },
    /// A short circuit: readings far too low.
    UnpluggedLow {
        /// Value that is read then, in the readings' unit.
        reading: f64,
    },
    /// Contacts add a resistance.
    BaselineStep {
        /// A share of the least reading.
        share: f64,
    },
    /// The readings' change over the least one is so many times what it should be.
    GainChange {
        /// The factor.
        factor: f64,
    },
    /// Changes over the least reading have the wrong sign.
    PolarityFlip,
    /// Times are off, though readings are of the right ones; rows keep their order.
    Jitter {
        /// Standard deviation, a share of a step.
        share: f64,
    },
    /// A share of the rows comes twice, with the same time.
    Duplicated {
        /// 0 to 1.
        share: f64,
    },
    /// A share of the rows comes after the next one, so that time goes backwards.
    Late {
        /// 0 to 1.
        share: f64,
    },
    /// The sensor's resistance at rest is so many times that of the calibration.
    WrongRest {
        /// The factor.
        factor: f64,
    },
    /// The sensor has slipped: the body's strain is more than the sensor's by this.
    Slipped {
        /// Offset, in the reference's unit.
        by: f64,
    },
    /// The clock runs so many times too fast.
    WrongRate {
        /// The factor.
        factor: f64,
    },
}

impl Fault {
    /// Its name, without its severity.
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
    /// End, s; infinite for a fault that stays.
    pub until_s: f64,
    /// Equal seeds give equal episodes.
    pub seed: u64,
}

impl Episode {
    /// The recording with the fault in it; its times may repeat or go backwards where the fault is of that kind.
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
