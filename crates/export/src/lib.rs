//! A calibrated sensor's filter as source code for a microcontroller: C99 with a self-test, or constants in Rust.
//!
//! Exported code computes in `f32`, at a fixed rate, operation by operation as the Rust filter does (`twin`); the same sensor and interval give the same files.

mod arithmetic;
mod boards;
mod budget;
mod constants;
mod correction;
mod cost;
mod firmware;
mod fixed_rate;
mod hand;
mod law;
mod literal;
mod motion;
mod pace;
mod plan;
mod prefix;
mod promise;
mod quadratic;
mod reduced;
mod replay;
mod steps;
mod twin;
mod vectors;

use std::str::FromStr;

use minijinja::Environment;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use ohmstrain_sensor::{EstimatorKind, SensorParams};
use serde::Serialize;

pub use boards::{BOARDS, Board};
pub use budget::{Budget, Candidate, Room, candidates, first_fitting};
use constants::Exported;
pub use cost::{Cost, Processor, cost};
pub use firmware::Firmware;
pub use hand::{Divider, HandChannel, HandFirmware, HandJoint};
use ohmstrain::MADE_BY;
pub use pace::usual_step_s;
pub use plan::{ChipFilter, Plan};
pub use prefix::Prefix;
pub use promise::{Compared, Promise};
pub use replay::{ChipEstimate, ReplayedRow, replay};

/// A language that sensors are exported to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportTarget {
    /// C99 with an Arduino sketch and a self-test.
    C,
    /// A module of constants for a `no_std` crate.
    Rust,
}

impl FromStr for ExportTarget {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "c" => Ok(Self::C),
            "rust" => Ok(Self::Rust),
            other => Err(format!("expected c or rust, found `{other}`")),
        }
    }
}

/// A file to write.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// Path in the folder.
    pub path: String,
    /// Its text.
    pub content: String,
}

/// The estimators that have an exported form.
pub const FILTERS: [EstimatorKind; 5] = [
    EstimatorKind::Corrected,
    EstimatorKind::SignSplit,
    EstimatorKind::Hypotheses,
    EstimatorKind::Ekf,
    EstimatorKind::StaticCubic,
];

/// Reason why there is no source code.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The sensor has a part without an exported form.
    #[error("{what}; {instead}")]
    Unsupported {
        /// The part of the sensor.
        what: String,
        /// Way to obtain a sensor file without it.
        instead: &'static str,
    },
    /// A parameter that `f32`, or the filter, cannot work with.
    #[error("{0}")]
    Parameter(String),
    /// The interval does not suit the sensor.
    #[error("{0}")]
    Interval(String),
    /// Even the smallest filter does not fit.
    #[error(
        "nothing fits; the smallest filter of this sensor takes about {} instructions a step, {} B of flash and {} B of RAM: {lacks}",
        least.instructions, least.flash, least.ram()
    )]
    Budget {
        /// Cost of the smallest filter.
        least: Cost,
        /// Resource that it exceeds.
        lacks: String,
    },
    /// The template failed.
    #[error("cannot fill the template of an exported file: {0}")]
    Template(#[from] minijinja::Error),
}

/// Creates the error of a number that the filter refuses.
fn parameter(error: impl ToString) -> ExportError {
    ExportError::Parameter(error.to_string())
}

/// Creates the error of a law without a filter for its number of branches.
fn too_many_branches() -> ExportError {
    ExportError::Unsupported {
        what: "the law has more than four branches".into(),
        instead: "calibrate with `--branches 4` or fewer",
    }
}

/// Name in the exported folder, and template.
type Template = (&'static str, &'static str);

/// Layout of an Arduino library, which PlatformIO accepts, too, and of a Zephyr module: only `src` is compiled into a program,
/// not the self-test with its `main`.
const C: [Template; 21] = [
    ("src/ohmstrain.h", include_str!("templates/ohmstrain.h")),
    ("src/ohmstrain.c", include_str!("templates/ohmstrain.c")),
    ("examples/ohmstrain_plotter/ohmstrain_plotter.ino", include_str!("templates/ohmstrain.ino")),
    ("examples/recorder/recorder.ino", include_str!("templates/recorder.ino")),
    ("examples/stm32_hal/ohmstrain_app.h", include_str!("templates/stm32/ohmstrain_app.h")),
    ("examples/stm32_hal/ohmstrain_app.c", include_str!("templates/stm32/ohmstrain_app.c")),
    ("examples/zephyr/CMakeLists.txt", include_str!("templates/zephyr/app.cmake")),
    ("examples/zephyr/prj.conf", include_str!("templates/zephyr/prj.conf")),
    ("examples/zephyr/src/main.c", include_str!("templates/zephyr/main.c")),
    (
        "examples/zephyr/boards/nrf52840dk_nrf52840.overlay",
        include_str!("templates/zephyr/nrf52840dk_nrf52840.overlay"),
    ),
    ("examples/zephyr/boards/nucleo_g474re.overlay", include_str!("templates/zephyr/nucleo_g474re.overlay")),
    ("zephyr/module.yml", include_str!("templates/zephyr/module.yml")),
    ("zephyr/CMakeLists.txt", include_str!("templates/zephyr/module.cmake")),
    ("zephyr/Kconfig", include_str!("templates/zephyr/Kconfig")),
    ("library.properties", include_str!("templates/library.properties")),
    ("library.json", include_str!("templates/library.json")),
    ("selftest/vectors.h", include_str!("templates/vectors.h")),
    ("selftest/selftest.c", include_str!("templates/selftest.c")),
    ("selftest/replay.c", include_str!("templates/replay.c")),
    ("CMakeLists.txt", include_str!("templates/CMakeLists.txt")),
    ("README.md", include_str!("templates/readme_c.md")),
];

/// Files that other templates include: `cells.c` both replays, the others `ohmstrain.c`.
const C_PARTS: [Template; 4] = [
    ("listed.c", include_str!("templates/listed.c")),
    ("hypotheses.c", include_str!("templates/hypotheses.c")),
    ("correction.c", include_str!("templates/correction.c")),
    ("cells.c", include_str!("templates/cells.c")),
];

const RUST: [Template; 2] =
    [("sensor.rs", include_str!("templates/sensor.rs")), ("README.md", include_str!("templates/readme_rust.md"))];

/// Returns an environment with the parts that templates include. Variables stand between `<<` and `>>`: C contains many double
/// braces.
fn environment() -> Result<Environment<'static>, ExportError> {
    let mut environment = Environment::new();
    let syntax = SyntaxConfig::builder()
        .variable_delimiters("<<", ">>")
        .trim_blocks(true)
        .lstrip_blocks(true)
        .keep_trailing_newline(true)
        .build()?;
    environment.set_syntax(syntax);
    for (name, part) in C_PARTS {
        environment.add_template(name, part)?;
    }
    Ok(environment)
}

/// Fills templates, and puts the prefix into their paths and contents.
fn filled(templates: &[Template], values: &impl Serialize, prefix: &Prefix) -> Result<Vec<SourceFile>, ExportError> {
    let environment = environment()?;
    let file = |(path, template): &Template| {
        let content = environment.render_named_str(path, template, Serde(values))?;
        Ok(SourceFile { path: prefix.put_into(path), content: prefix.put_into(&content) })
    };
    templates.iter().map(file).collect()
}

/// Returns the files of a sensor with readings every `dt_s` seconds; the header repeats its promise.
///
/// # Errors
/// See [`ExportError`].
pub fn files(
    params: &SensorParams,
    plan: &Plan,
    target: ExportTarget,
    dt_s: f64,
    prefix: &Prefix,
    promise: &[String],
) -> Result<Vec<SourceFile>, ExportError> {
    let exported = Exported::new(params, plan, MADE_BY, dt_s, promise)?;
    let templates: &[Template] = match target {
        ExportTarget::C => &C,
        ExportTarget::Rust => &RUST,
    };
    filled(templates, &exported, prefix)
}
