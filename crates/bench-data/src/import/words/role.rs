use std::fmt;
use std::str::FromStr;

/// Role of a column in a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// Time of the readings, and of all other columns in the same file without a clock of their own.
    Time,
    /// Time of the reference.
    ReferenceTime,
    /// Resistance.
    Resistance,
    /// Resistance over the resistance at rest, or its change.
    Ratio,
    /// Converter codes.
    Adc,
    /// Strain.
    Strain,
    /// Displacement from rest.
    Displacement,
    /// Angle of a joint.
    Angle,
    /// Temperature.
    Temperature,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Time,
        Self::ReferenceTime,
        Self::Resistance,
        Self::Ratio,
        Self::Adc,
        Self::Strain,
        Self::Displacement,
        Self::Angle,
        Self::Temperature,
    ];
    pub(crate) const READINGS: [Self; 3] = [Self::Resistance, Self::Ratio, Self::Adc];
    pub(crate) const REFERENCES: [Self; 3] = [Self::Strain, Self::Displacement, Self::Angle];

    /// Returns its name in flags.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::ReferenceTime => "reference-time",
            Self::Resistance => "resistance",
            Self::Ratio => "ratio",
            Self::Adc => "adc",
            Self::Strain => "strain",
            Self::Displacement => "displacement",
            Self::Angle => "angle",
            Self::Temperature => "temperature",
        }
    }

    /// Returns the role that represents all roles with the same units.
    pub(crate) const fn quantity(self) -> Self {
        match self {
            Self::ReferenceTime => Self::Time,
            role => role,
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

impl FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.replace('_', "-");
        Self::ALL.into_iter().find(|role| role.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|role| role.name()).collect();
            format!("expected one of {}", names.join(", "))
        })
    }
}
