//! Files of protocols for a person.

use std::path::Path;

use ohmstrain_bench_data::ReferenceQuantity;
use ohmstrain_bench_data::pacing::{PacedStep, Pacing, Position};
use serde::{Deserialize, Serialize};

use crate::error::CliError;
use crate::whole_file;

/// Version of the file format.
const FORMAT: u32 = 1;
/// Standard deviation with which a person keeps a position, as a share of the span of all positions; for positions without a
/// stated one.
const KEPT_SD: f64 = 0.02;

/// `protocol.toml`.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    made_by: Option<String>,
    /// Joints that have values of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    joints: Vec<String>,
    /// Number of times that the steps are repeated.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    repeat: usize,
    positions: Vec<WrittenPosition>,
    #[serde(default)]
    steps: Vec<WrittenStep>,
}

const fn once() -> usize {
    1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
const fn is_once(repeat: &usize) -> bool {
    *repeat == 1
}

/// A position: a strain or an angle, common to all joints or one for each.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct WrittenPosition {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    strain: Option<Values>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    strain_sd: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    angle_deg: Option<Values>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    angle_sd: Option<f64>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged)]
enum Values {
    One(f64),
    Each(Vec<f64>),
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct WrittenStep {
    to: String,
    #[serde(default)]
    move_s: f64,
    hold_s: f64,
}

/// Reads a protocol.
///
/// # Errors
/// If it cannot be read, has an unknown field, or cannot be followed.
pub fn read(path: &Path) -> Result<Pacing, CliError> {
    let name = path.display();
    let text = whole_file::text(path)?;
    let wrong = |error: toml::de::Error| {
        let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        CliError::Input(format!("{name}:{line}: {}", error.message().replace('\n', " ")))
    };
    let file: File = toml::from_str(&text).map_err(wrong)?;
    if file.format != FORMAT {
        return Err(CliError::Input(format!("{name}: expected `format = {FORMAT}`, found {}", file.format)));
    }
    let pacing = file.pacing().map_err(|what| CliError::Input(format!("{name}: {what}")))?;
    pacing.validate().map_err(|error| CliError::Input(format!("{name}: {error}")))?;
    Ok(pacing)
}

impl File {
    fn pacing(self) -> Result<Pacing, String> {
        let joints = self.joints.len().max(1);
        let are_angles = self.positions.iter().any(|position| position.angle_deg.is_some());
        let (quantity, column) =
            if are_angles { (ReferenceQuantity::AngleDeg, "angle_deg") } else { (ReferenceQuantity::Strain, "strain") };
        let mut positions = Vec::with_capacity(self.positions.len());
        for position in &self.positions {
            let (found, sd, other, other_sd) = match quantity {
                ReferenceQuantity::AngleDeg => {
                    (&position.angle_deg, position.angle_sd, &position.strain, ("strain_sd", position.strain_sd))
                }
                ReferenceQuantity::Strain => {
                    (&position.strain, position.strain_sd, &position.angle_deg, ("angle_sd", position.angle_sd))
                }
            };
            if let (name, Some(_)) = other_sd {
                return Err(format!("position `{}`: expected no `{name}` beside `{column}`, found one", position.name));
            }
            let values = match found {
                _ if other.is_some() => {
                    return Err(format!(
                        "position `{}`: expected `{column}` alone, as others have it, found `strain` too",
                        position.name
                    ));
                }
                Some(Values::One(value)) => vec![*value; joints],
                Some(Values::Each(values)) => values.clone(),
                None => return Err(format!("position `{}`: expected `{column}`, found none", position.name)),
            };
            positions.push((position.name.clone(), values, sd.unwrap_or(f64::NAN)));
        }
        let mut pacing = pacing(quantity, self.joints, positions);
        let positions = &pacing.positions;
        let place = |name: &String| {
            let found = positions.iter().position(|position| position.name == *name);
            let names =
                || positions.iter().map(|position| format!("`{}`", position.name)).collect::<Vec<_>>().join(", ");
            found.ok_or_else(|| format!("step to `{name}`: expected one of the positions {}", names()))
        };
        let step =
            |step: &WrittenStep| Ok(PacedStep { to: place(&step.to)?, move_s: step.move_s, hold_s: step.hold_s });
        let round: Vec<PacedStep> = self.steps.iter().map(step).collect::<Result<_, String>>()?;
        let most = round.len().saturating_mul(self.repeat).min(1 << 16);
        pacing.steps = round.iter().copied().cycle().take(most).collect();
        Ok(pacing)
    }
}

/// Creates a protocol without steps; a position whose standard deviation is NaN gets a share of the span of all positions.
pub fn pacing(quantity: ReferenceQuantity, joints: Vec<String>, positions: Vec<(String, Vec<f64>, f64)>) -> Pacing {
    let all = || positions.iter().flat_map(|(_, values, _)| values.iter().copied());
    let span = all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min);
    let kept = |sd: f64| if sd.is_nan() { KEPT_SD * span } else { sd };
    let position = |(name, values, sd): (String, Vec<f64>, f64)| Position { name, values, sd: kept(sd) };
    Pacing { quantity, joints, positions: positions.into_iter().map(position).collect(), steps: Vec::new() }
}

/// Formats a protocol as the text of a file.
///
/// # Errors
/// If it cannot be serialised.
pub fn text(pacing: &Pacing) -> Result<String, CliError> {
    let values = |position: &Position| match &position.values[..] {
        [one] => Values::One(*one),
        each if each.iter().all(|value| *value == each[0]) => Values::One(each[0]),
        each => Values::Each(each.to_vec()),
    };
    let position = |position: &Position| {
        let (name, of_strain) = (position.name.clone(), pacing.quantity == ReferenceQuantity::Strain);
        let (own, sd) = (Some(values(position)), Some(position.sd));
        let none = WrittenPosition { name, strain: None, strain_sd: None, angle_deg: None, angle_sd: None };
        if of_strain {
            WrittenPosition { strain: own, strain_sd: sd, ..none }
        } else {
            WrittenPosition { angle_deg: own, angle_sd: sd, ..none }
        }
    };
    let step = |step: &PacedStep| WrittenStep {
        to: pacing.positions[step.to].name.clone(),
        move_s: step.move_s,
        hold_s: step.hold_s,
    };
    let file = File {
        format: FORMAT,
        made_by: Some(ohmstrain::MADE_BY.into()),
        joints: pacing.joints.clone(),
        repeat: 1,
        positions: pacing.positions.iter().map(position).collect(),
        steps: pacing.steps.iter().map(step).collect(),
    };
    toml::to_string(&file).map_err(|error| CliError::Other(format!("cannot write the protocol: {error}")))
}
