use ohmstrain_ekf::correction::{FEATURES, OUTPUTS};

use super::table::{FACTOR, FieldError, POSITIVE, SIGNED, Table};
use crate::params::correction::{
    CorrectionParams, CorrectionScale, CorrectorParams, FUTURE_FEATURES, ProcessParams, SIDES, SimulatedParams,
    SimulatedRow, TrainingRow,
};
use crate::params::estimator::EstimatorKind;

/// Training rows that a file may have: the work grows with their cube.
const ROWS: std::ops::RangeInclusive<usize> = 2..=1000;

impl CorrectionParams {
    pub(crate) fn validate(&self, table: &Table) -> Result<(), FieldError> {
        if self.corrects == EstimatorKind::Corrected {
            return Err(table.wrong("corrects", "a filter", self.corrects.name()));
        }
        self.readings.validate(&table.table("readings"))?;
        self.filter.validate(&table.table("filter"), 0)?;
        self.smoother.validate(&table.table("smoother"), SIDES)?;
        count(table, self.rows.len())?;
        self.rows.iter().enumerate().try_for_each(|(index, row)| row.validate(&table.entry("rows", index)))?;
        self.simulated.validate(&table.table("simulated"))
    }
}

fn count(table: &Table, rows: usize) -> Result<(), FieldError> {
    let expected = || format!("{} to {} entries", ROWS.start(), ROWS.end());
    if ROWS.contains(&rows) { Ok(()) } else { Err(table.wrong("rows", expected(), rows)) }
}

impl SimulatedParams {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("sd", self.sd, POSITIVE)?;
        count(table, self.rows.len())?;
        self.rows.iter().enumerate().try_for_each(|(index, row)| row.validate(&table.entry("rows", index)))
    }
}

impl SimulatedRow {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.numbers("past", &self.past, SIGNED)?;
        table.number("strain", self.strain, SIGNED)
    }
}

impl CorrectionScale {
    pub(crate) fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("centre", self.centre, SIGNED)?;
        table.number("half_range", self.half_range, POSITIVE)?;
        table.numbers("rates", &self.rates, POSITIVE)?;
        table.numbers("starts", self.starts.as_flattened(), SIGNED)
    }
}

impl CorrectorParams {
    fn validate(&self, table: &Table, sides: usize) -> Result<(), FieldError> {
        table.number("sd_scale", self.sd_scale, FACTOR)?;
        let future = if sides == 0 { 0 } else { FUTURE_FEATURES };
        self.direct.validate(&table.table("direct"), FEATURES + future)?;
        self.residual.validate(&table.table("residual"), OUTPUTS + FEATURES + future)?;
        if self.one_sided.len() != sides {
            return Err(table.wrong("one_sided", format!("{sides} entries"), self.one_sided.len()));
        }
        let mut one_sided = self.one_sided.iter().zip([FEATURES, 1 + FUTURE_FEATURES]).enumerate();
        one_sided.try_for_each(|(index, (side, inputs))| side.validate(&table.entry("one_sided", index), inputs))
    }
}

impl ProcessParams {
    fn validate(&self, table: &Table, inputs: usize) -> Result<(), FieldError> {
        table.length("lengths", inputs, self.lengths.len())?;
        table.numbers("lengths", &self.lengths, FACTOR)?;
        table.number("noise", self.noise, FACTOR)?;
        table.number("noise_time_s", self.noise_time_s, POSITIVE)?;
        table.number("sd_scale", self.sd_scale, FACTOR)
    }
}

impl TrainingRow {
    pub(crate) fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.number("time_s", self.time_s, SIGNED)?;
        table.number("strain", self.strain, SIGNED)?;
        table.numbers("past", &self.past, SIGNED)?;
        table.numbers("future", &self.future, SIGNED)?;
        table.numbers("filtered", &self.filtered, SIGNED)?;
        table.numbers("smoothed", &self.smoothed, SIGNED)
    }
}
