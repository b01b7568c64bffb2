//! Recordings of a simulated bench, based on the protocols of the published work on carbon-black/silicone sensors.
//!
//! A sensor 30 mm long is stretched by a machine whose strain is known exactly (to 1e-5). The three materials are *illustrative*: no table
//! of fitted parameters is available for them, so theirs are chosen to reproduce the published findings about each, see [`Material`]. The
//! sensor follows the switched Kelvin-Voigt law with two branches, the family that is fitted elsewhere, or, with `mismatched`, deliberately
//! a law outside that family, because judging a filter on data from its own law shows little. The mismatched sensor is modelled on measured
//! 10 wt-% carbon-black silicone, whose R rises to 1.58 to 1.65 R₀ at a strain of 0.06 to 0.18 on release, higher at higher speed, and
//! keeps 6 to 13 % of R₀ after 290 s at rest.
//!
//! ```
//! use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
//! let settings = SimulationSettings { seed: 7, ..SimulationSettings::new(Material::Ecoflex0030, Protocol::EXTEND_HOLD) };
//! let trace = simulate(&settings)?;
//! assert_eq!(trace.metadata.gauge_length_mm, Some(30.0));
//! # Ok::<(), ohmstrain_bench_data::simulate::SettingsError>(())
//! ```

mod bench;
mod chamber;
mod individual;
mod matched;
mod material;
mod mismatched;
mod noise;
mod person;
mod profile;
mod protocol;
mod sensor;
mod settings;

pub use bench::simulate;
pub use chamber::Chamber;
pub use material::{Material, UnknownMaterial};
pub use noise::Disturbances;
pub(crate) use noise::normal;
pub use person::{Followed, Person};
pub use protocol::{Protocol, UnknownProtocol};
pub use settings::{SettingsError, SimulationSettings};

/// Length of the simulated sensor at rest, mm.
const GAUGE_LENGTH_MM: f64 = 30.0;
