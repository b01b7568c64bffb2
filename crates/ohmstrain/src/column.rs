use ohmstrain_sensor::{Quantity, ReadingUnit, SensorParams};

use crate::Estimate;

/// One column of `estimates.csv`; see [`Sensor::columns`](crate::Sensor::columns).
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let row = sensor.filter().build()?.step(0.0, 1600.0)?;
/// for column in sensor.columns() {
///     println!("{} = {}", column.name(), column.number(&row));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    name: &'static str,
    cell: Cell,
}

/// Content of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cell {
    Time,
    Reading,
    Strain,
    StrainSd,
    Rate,
    RateSd,
    Relaxation,
    RelaxationSd,
    Baseline,
    Settled,
    SettledSd,
    Extend,
    Hold,
    Retract,
    BeyondBorder,
    Nis,
    Flags,
    Angle,
    AngleSd,
}

impl Cell {
    /// All cells in the order of the columns; the last two need a joint.
    const ALL: [Self; 19] = [
        Self::Time,
        Self::Reading,
        Self::Strain,
        Self::StrainSd,
        Self::Rate,
        Self::RateSd,
        Self::Relaxation,
        Self::RelaxationSd,
        Self::Baseline,
        Self::Settled,
        Self::SettledSd,
        Self::Extend,
        Self::Hold,
        Self::Retract,
        Self::BeyondBorder,
        Self::Nis,
        Self::Flags,
        Self::Angle,
        Self::AngleSd,
    ];
}

impl Column {
    /// Returns its name in the header, which contains the unit of the readings or the estimated quantity.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.columns()[1].name(), "resistance_ohm");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// True if these are the names of all columns of the estimates of some sensor, in order.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let columns = sensor.columns();
    /// assert!(ohmstrain::Column::are_all(columns.iter().map(|column| column.name())));
    /// assert!(!ohmstrain::Column::are_all(["time_s", "resistance_ohm", "strain"].into_iter()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn are_all<'a>(names: impl Iterator<Item = &'a str> + Clone) -> bool {
        Header::ALL.into_iter().any(|header| names.clone().eq(header.columns().map(|column| column.name)))
    }

    /// True for the column of the flags, the only one without numbers.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert!(sensor.columns()[16].is_flags());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn is_flags(&self) -> bool {
        matches!(self.cell, Cell::Flags)
    }

    /// Returns the number of a row; NaN if it is unknown, and for the flags.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let row = sensor.filter().build()?.step(0.0, 1600.0)?;
    /// assert_eq!(sensor.columns()[2].number(&row), row.strain);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn number(&self, row: &Estimate) -> f64 {
        let known = |cell: Option<f64>| cell.unwrap_or(f64::NAN);
        match self.cell {
            Cell::Time => row.time_s,
            Cell::Reading => known(row.resistance),
            Cell::Strain => row.strain,
            Cell::StrainSd => row.strain_sd,
            Cell::Rate => row.strain_rate,
            Cell::RateSd => row.strain_rate_sd,
            Cell::Relaxation => row.relaxation,
            Cell::RelaxationSd => row.relaxation_sd,
            Cell::Baseline => row.baseline,
            Cell::Settled => row.settled_resistance,
            Cell::SettledSd => row.settled_resistance_sd,
            Cell::Extend => known(row.p_extend),
            Cell::Hold => known(row.p_hold),
            Cell::Retract => known(row.p_retract),
            Cell::BeyondBorder => row.p_beyond_border,
            Cell::Nis => known(row.nis),
            Cell::Flags => f64::NAN,
            Cell::Angle => known(row.angle_deg),
            Cell::AngleSd => known(row.angle_sd),
        }
    }
}

/// Properties of a sensor that determine the names of its columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    reading: ReadingUnit,
    quantity: Quantity,
    has_joint: bool,
}

impl Header {
    pub(crate) const OHM_STRAIN: Self =
        Self { reading: ReadingUnit::Ohm, quantity: Quantity::Strain, has_joint: false };

    /// Headers of all possible sensors. A sensor calibrated on an angle has no separate joint.
    const ALL: [Self; 6] = {
        let strain = Self::OHM_STRAIN;
        let angle = Self { quantity: Quantity::AngleDeg, ..strain };
        let joint = Self { has_joint: true, ..strain };
        let ratio = ReadingUnit::Ratio;
        [
            strain,
            angle,
            joint,
            Self { reading: ratio, ..strain },
            Self { reading: ratio, ..angle },
            Self { reading: ratio, ..joint },
        ]
    };

    pub(crate) const fn of(params: &SensorParams) -> Self {
        Self { reading: params.reading, quantity: params.quantity, has_joint: params.joint.is_some() }
    }

    /// Returns the number of columns.
    pub(crate) const fn len(self) -> usize {
        if self.has_joint { Cell::ALL.len() } else { Cell::ALL.len() - 2 }
    }

    /// Returns all columns, in order.
    pub(crate) fn columns(self) -> impl Iterator<Item = Column> {
        Cell::ALL.into_iter().take(self.len()).map(move |cell| Column { name: self.name(cell), cell })
    }

    const fn name(self, cell: Cell) -> &'static str {
        let (is_ohm, is_strain) = (matches!(self.reading, ReadingUnit::Ohm), matches!(self.quantity, Quantity::Strain));
        match cell {
            Cell::Time => "time_s",
            Cell::Reading => reading_column(self.reading),
            Cell::Strain if is_strain => "strain",
            Cell::Strain | Cell::Angle => "angle_deg",
            Cell::StrainSd if is_strain => "strain_sd",
            Cell::StrainSd | Cell::AngleSd => "angle_sd",
            Cell::Rate if is_strain => "strain_rate",
            Cell::Rate => "angle_rate",
            Cell::RateSd if is_strain => "strain_rate_sd",
            Cell::RateSd => "angle_rate_sd",
            Cell::Relaxation => "relaxation",
            Cell::RelaxationSd => "relaxation_sd",
            Cell::Baseline => "baseline",
            Cell::Settled if is_ohm => "settled_resistance_ohm",
            Cell::Settled => "settled_resistance_ratio",
            Cell::SettledSd if is_ohm => "settled_resistance_sd_ohm",
            Cell::SettledSd => "settled_resistance_sd_ratio",
            Cell::Extend => "p_extend",
            Cell::Hold => "p_hold",
            Cell::Retract => "p_retract",
            Cell::BeyondBorder => "p_beyond_border",
            Cell::Nis => "nis",
            Cell::Flags => "flags",
        }
    }
}

/// Returns the name of the column of readings, the same in every file.
#[must_use]
pub const fn reading_column(unit: ReadingUnit) -> &'static str {
    match unit {
        ReadingUnit::Ohm => "resistance_ohm",
        ReadingUnit::Ratio => "resistance_ratio",
    }
}
