use crate::import::error::ImportError;
use crate::import::words::{Role, Unit};

/// Place of a column: the file and the column in it, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileColumn {
    pub file: usize,
    pub column: usize,
}

/// A column with its assigned role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Taken {
    pub role: Role,
    pub place: FileColumn,
}

/// A column from which numbers are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channel {
    pub role: Role,
    pub place: FileColumn,
    pub unit: Unit,
}

/// Source of times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    Column(Channel),
    /// Rows of a file are evenly spaced at this rate, 1/s.
    Rate {
        file: usize,
        hz: f64,
    },
}

impl Clock {
    pub(crate) const fn file(&self) -> usize {
        match self {
            Self::Column(channel) => channel.place.file,
            Self::Rate { file, .. } => *file,
        }
    }

    pub(crate) const fn column(&self) -> Option<Channel> {
        match self {
            Self::Column(channel) => Some(*channel),
            Self::Rate { .. } => None,
        }
    }

    /// True if both are the same column or rate, whatever its role and unit.
    fn is(&self, other: &Self) -> bool {
        match (self.column(), other.column()) {
            (Some(one), Some(other)) => one.place == other.place,
            _ => self == other,
        }
    }
}

/// Values and the clock of their rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timed {
    pub values: Channel,
    pub clock: Clock,
}

/// Imported columns, and open questions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Decision {
    /// Channels of readings; the first one becomes the trace. Another sensor or another recording is another entry.
    pub readings: Vec<Timed>,
    pub reference: Option<Timed>,
    pub temperature: Option<Channel>,
    /// Conclusions from names or numbers that no answer stated.
    pub remarks: Vec<String>,
    /// Open questions, the most important one first; if there are none, there are readings.
    pub questions: Vec<ImportError>,
}

impl Decision {
    /// True if readings and reference are in the same rows with the same times.
    pub(crate) fn is_one_clock(&self) -> bool {
        let Some(reference) = &self.reference else { return true };
        self.readings.iter().all(|readings| reference.clock.is(&readings.clock))
    }

    /// Returns the columns from which anything is read.
    pub(crate) fn channels(&self) -> Vec<Channel> {
        let mut all = Vec::new();
        for readings in &self.readings {
            all.extend(readings.clock.column());
            all.push(readings.values);
        }
        if let Some(Timed { values, clock }) = &self.reference {
            let own = clock.column().filter(|_| !self.is_one_clock());
            all.extend(own.map(|own| Channel { role: Role::ReferenceTime, ..own }));
            all.push(*values);
        }
        all.extend(self.temperature);
        all
    }
}
