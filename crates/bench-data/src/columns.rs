use csv::StringRecord;

use crate::error::{Fault, quote};
use crate::row::ReferenceQuantity;

/// Columns with a meaning in a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Column {
    TimeS,
    TimeUs,
    ResistanceOhm,
    ResistanceRatio,
    Adc,
    Strain,
    DisplacementMm,
    AngleDeg,
    StrainSd,
    AngleSd,
    TemperatureC,
}

impl Column {
    /// All of them.
    #[cfg(feature = "import")]
    pub(crate) const ALL: [Self; 11] = [
        Self::TimeS,
        Self::TimeUs,
        Self::ResistanceOhm,
        Self::ResistanceRatio,
        Self::Adc,
        Self::Strain,
        Self::DisplacementMm,
        Self::AngleDeg,
        Self::StrainSd,
        Self::AngleSd,
        Self::TemperatureC,
    ];
    const TIMES: [Self; 2] = [Self::TimeS, Self::TimeUs];
    const READINGS: [Self; 3] = [Self::ResistanceOhm, Self::ResistanceRatio, Self::Adc];
    const REFERENCES: [Self; 3] = [Self::Strain, Self::DisplacementMm, Self::AngleDeg];

    /// Returns the column of this one's standard deviation.
    pub(crate) const fn deviation(self) -> Option<Self> {
        match self {
            Self::Strain => Some(Self::StrainSd),
            Self::AngleDeg => Some(Self::AngleSd),
            _ => None,
        }
    }

    /// Returns the column of a reference.
    pub(crate) const fn of_reference(quantity: ReferenceQuantity) -> Self {
        match quantity {
            ReferenceQuantity::Strain => Self::Strain,
            ReferenceQuantity::AngleDeg => Self::AngleDeg,
        }
    }

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::TimeS => "time_s",
            Self::TimeUs => "time_us",
            Self::ResistanceOhm => "resistance_ohm",
            Self::ResistanceRatio => "resistance_ratio",
            Self::Adc => "adc",
            Self::Strain => "strain",
            Self::DisplacementMm => "displacement_mm",
            Self::AngleDeg => "angle_deg",
            Self::StrainSd => "strain_sd",
            Self::AngleSd => "angle_sd",
            Self::TemperatureC => "temperature_c",
        }
    }
}

/// A column and its place in a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColumnPlace {
    pub column: Column,
    index: usize,
}

impl ColumnPlace {
    pub(crate) fn cell<'a>(&self, record: &'a StringRecord) -> &'a str {
        record.get(self.index).unwrap_or_default().trim()
    }
}

/// Places of a file's columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    pub time: ColumnPlace,
    pub reading: ColumnPlace,
    pub reference: Option<ColumnPlace>,
    pub reference_sd: Option<ColumnPlace>,
    pub temperature: Option<ColumnPlace>,
    pub width: usize,
}

impl Columns {
    pub(crate) fn of_header(header: &StringRecord) -> Result<Self, Fault> {
        let exactly_one = |group: &[Column]| {
            let found = || quote(&header.iter().collect::<Vec<_>>().join(","));
            one_of(header, group)?
                .ok_or_else(|| Fault::new(format!("a header with the column {}", names(group)), found()).foreign())
        };
        let reference = one_of(header, &Column::REFERENCES)?;
        let deviation = reference.and_then(|place| place.column.deviation());
        Ok(Self {
            time: exactly_one(&Column::TIMES)?,
            reading: exactly_one(&Column::READINGS)?,
            reference,
            reference_sd: deviation.map_or(Ok(None), |column| one_of(header, &[column]))?,
            temperature: one_of(header, &[Column::TemperatureC])?,
            width: header.len(),
        })
    }
}

/// Returns the one column of a group, or none.
fn one_of(header: &StringRecord, group: &[Column]) -> Result<Option<ColumnPlace>, Fault> {
    let mut seen: Option<ColumnPlace> = None;
    for (index, name) in header.iter().enumerate() {
        let Some(column) = group.iter().copied().find(|column| column.name() == name.trim()) else { continue };
        if let Some(first) = seen {
            let found = format!("{} and {}", quote(first.column.name()), quote(column.name()));
            return Err(Fault::in_column(column.name(), format!("one column {}", names(group)), found));
        }
        seen = Some(ColumnPlace { column, index });
    }
    Ok(seen)
}

fn names(group: &[Column]) -> String {
    group.iter().map(|column| format!("`{}`", column.name())).collect::<Vec<_>>().join(" or ")
}
