//! Units of a table's readings and reference, from the caller's answers or the table's own metadata.

use arrow_schema::Schema;
use ohmstrain::{JointParams, Quantity};
use ohmstrain_bench_data::{FrontEndSpec, JointSpec, ResistanceUnit, StrainUnit};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Place, raise};

/// Data that a table does not contain; in a trace CSV they stand above the header.
#[derive(Debug, Default, Deserialize, Serialize, FromPyObject)]
#[pyo3(from_item_all)]
#[serde(default)]
pub struct About {
    pub name: Option<String>,
    pub gauge_length_mm: Option<f64>,
    pub front_end: Option<String>,
    pub joint: Option<String>,
    pub strain_unit: Option<String>,
    pub resistance_unit: Option<String>,
}

/// Key of a schema's metadata under which `read` stores the lines above a file's header, as JSON.
pub const ABOUT: &str = "ohmstrain";

impl About {
    fn place(&self) -> Place<'_> {
        Place { file: self.name.as_deref(), ..Place::default() }
    }

    /// Completes the data with the table's own metadata.
    pub fn completed(self, schema: &Schema) -> PyResult<Self> {
        let Some(text) = schema.metadata().get(ABOUT) else { return Ok(self) };
        let known: Self = serde_json::from_str(text).map_err(|error| raise(&self.place(), &error.to_string()))?;
        Ok(Self {
            name: self.name.or(known.name),
            gauge_length_mm: self.gauge_length_mm.or(known.gauge_length_mm),
            front_end: self.front_end.or(known.front_end),
            joint: self.joint.or(known.joint),
            strain_unit: self.strain_unit.or(known.strain_unit),
            resistance_unit: self.resistance_unit.or(known.resistance_unit),
        })
    }

    pub fn joint_spec(&self) -> PyResult<Option<JointSpec>> {
        parsed("joint", self.joint.as_deref(), self.name.as_deref())
    }

    /// Returns the joint that the sensor is mounted on.
    pub fn joint(&self) -> PyResult<Option<JointParams>> {
        Ok(self.joint_spec()?.map(|joint| JointParams {
            prestrain: joint.prestrain,
            moment_arm_mm: joint.moment_arm_mm,
            gauge_length_mm: joint.gauge_length_mm,
        }))
    }

    #[expect(clippy::type_complexity, reason = "two columns of a recording")]
    pub fn readings(&self, name: &'static str, values: Vec<f64>) -> PyResult<(Vec<f64>, Option<Vec<(f64, bool)>>)> {
        let file = self.name.as_deref();
        let unit = parsed::<ResistanceUnit>("resistance_unit", self.resistance_unit.as_deref(), file)?;
        if name != "adc" {
            let wrong = values.iter().position(|value| value.is_infinite() || *value <= 0.0);
            let factor = unit.filter(|_| name == "resistance_ohm").map_or(1.0, ResistanceUnit::factor);
            return match wrong {
                None => Ok((values.into_iter().map(|value| factor * value).collect(), None)),
                Some(row) => {
                    let place = Place { file, row: Some(row), column: Some(name) };
                    Err(raise(&place, &format!("expected a positive number, found {}", values[row])))
                }
            };
        }
        let Some(spec) = parsed::<FrontEndSpec>("front_end", self.front_end.as_deref(), file)? else {
            let place = Place { column: Some(name), ..self.place() };
            return Err(raise(&place, "expected `front_end` to be given, as in `# front_end = …` of a trace CSV"));
        };
        let front_end = spec.build().map_err(|error| raise(&self.place(), &format!("front_end: {error}")))?;
        let (mut readings, mut converter) = (Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        for (row, value) in values.into_iter().enumerate() {
            let code = (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0).then_some(value as u32);
            if code.is_none() && !value.is_nan() {
                let place = Place { file, row: Some(row), column: Some(name) };
                return Err(raise(&place, &format!("expected a converter's code, found {value}")));
            }
            let (ohm, sd, saturated) = match code.map(|code| front_end.read(code)) {
                None => (f64::NAN, f64::NAN, false),
                Some(ohmstrain_model::AdcCode::Saturated) => (f64::NAN, f64::NAN, true),
                Some(ohmstrain_model::AdcCode::Reading(ohms)) => (ohms.resistance_ohm, ohms.sd_ohm, false),
            };
            readings.push(ohm);
            converter.push((sd, saturated));
        }
        Ok((readings, Some(converter)))
    }

    pub fn reference(
        &self,
        name: &'static str,
        mut values: Vec<f64>,
        joint: Option<&JointSpec>,
    ) -> PyResult<(Quantity, Vec<f64>)> {
        let file = self.name.as_deref();
        if let Some(row) = values.iter().position(|value| value.is_infinite()) {
            let place = Place { file, row: Some(row), column: Some(name) };
            return Err(raise(&place, &format!("expected a finite number, found {}", values[row])));
        }
        let unit = parsed::<StrainUnit>("strain_unit", self.strain_unit.as_deref(), file)?;
        match (name, joint) {
            ("displacement_mm", _) => {
                let Some(length) = self.gauge_length_mm.filter(|length| length.is_finite() && *length > 0.0) else {
                    let place = Place { column: Some(name), ..self.place() };
                    return Err(raise(&place, "expected `gauge_length_mm` to be given, a positive number"));
                };
                values.iter_mut().for_each(|value| *value /= length);
                Ok((Quantity::Strain, values))
            }
            ("angle_deg", None) => Ok((Quantity::AngleDeg, values)),
            ("angle_deg", Some(joint)) => {
                let joint = joint.build().map_err(|error| raise(&self.place(), &format!("joint: {error}")))?;
                values.iter_mut().for_each(|value| *value = joint.strain(value.to_radians()));
                Ok((Quantity::Strain, values))
            }
            _ => {
                let factor = unit.map_or(1.0, StrainUnit::factor);
                values.iter_mut().for_each(|value| *value *= factor);
                Ok((Quantity::Strain, values))
            }
        }
    }
}

/// Parses the value of an argument; an error names the argument.
pub fn parsed<T: std::str::FromStr>(key: &str, text: Option<&str>, file: Option<&str>) -> PyResult<Option<T>>
where
    T::Err: std::fmt::Display,
{
    let wrong = |error: T::Err| raise(&Place { file, ..Place::default() }, &format!("{key}: {error}"));
    text.map(|text| text.parse().map_err(wrong)).transpose()
}
