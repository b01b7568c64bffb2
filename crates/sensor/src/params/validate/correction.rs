use std::ops::Range;

use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale, INDUCING, OUTPUTS};

use super::table::{AMOUNT, FACTOR, FieldError, POSITIVE, SIGNED, Table, WEIGHT, check};
use crate::correction::side_of;
use crate::params::correction::{
    CorrectionParams, CorrectorParams, InputScales, ProcessParams, SIDES, SMOOTHER_INPUTS, SimulatedParams, TrainingRow,
};
use crate::params::estimator::EstimatorKind;

/// Number of training rows that a file may have.
const ROWS: std::ops::RangeInclusive<usize> = 2..=1000;

impl CorrectionParams {
    pub(crate) fn validate(&self, table: &Table) -> Result<(), FieldError> {
        if matches!(self.corrects, EstimatorKind::Corrected | EstimatorKind::StaticCubic) {
            return Err(table.wrong("corrects", "a filter", self.corrects.name()));
        }
        table.scale("readings", &self.readings)?;
        let rows = self.rows.len();
        self.filter.validate(&table.table("filter"), FILTER_INPUTS, rows)?;
        self.smoother.validate(&table.table("smoother"), SMOOTHER_INPUTS, rows)?;
        count(table, rows)?;
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
        check!(table, self; mean: SIGNED, sd: POSITIVE, length: FACTOR)?;
        count(table, self.rows.len())?;
        table.length("weights", self.rows.len(), self.weights.len())?;
        table.numbers("weights", &self.weights, WEIGHT)?;
        self.rows.iter().enumerate().try_for_each(|(index, row)| table.numbers(&format!("rows[{index}]"), row, SIGNED))
    }
}

impl Table {
    /// Checks a scale of readings.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn scale(&self, name: &str, scale: &FeatureScale<f64>) -> Result<(), FieldError> {
        let table = self.table(name);
        check!(table, scale; centre: SIGNED, half_range: POSITIVE)?;
        table.numbers("rates", &scale.rates, POSITIVE)?;
        table.numbers("starts", scale.starts.as_flattened(), SIGNED)
    }
}

impl CorrectorParams {
    /// Checks a corrector with that number of inputs.
    fn validate(&self, table: &Table, inputs: usize, rows: usize) -> Result<(), FieldError> {
        check!(table, self; sd_scale: FACTOR, strain_sd: POSITIVE)?;
        table.length("order", rows, self.order.len())?;
        let mut missing = vec![true; rows];
        for (index, row) in self.order.iter().enumerate() {
            let is_new = missing.get_mut(*row).is_some_and(std::mem::take);
            if !is_new {
                return Err(table.wrong(&format!("order[{index}]"), format!("each of 0 to {} once", rows - 1), row));
            }
        }
        self.inputs.validate(&table.table("inputs"), inputs)?;
        self.direct.validate(&table.table("direct"), (OUTPUTS..inputs, Some(OUTPUTS)), rows)?;
        self.residual.validate(&table.table("residual"), (0..inputs, Some(0)), rows)?;
        let sides = if inputs == SMOOTHER_INPUTS { SIDES } else { 0 };
        if self.one_sided.len() != sides {
            return Err(table.wrong("one_sided", format!("{sides} entries"), self.one_sided.len()));
        }
        self.one_sided.iter().enumerate().try_for_each(|(index, side)| {
            side.validate(&table.entry("one_sided", index), (OUTPUTS..inputs, None), rows)
        })
    }
}

impl InputScales {
    fn validate(&self, table: &Table, inputs: usize) -> Result<(), FieldError> {
        let columns = [
            ("mean", &self.mean, SIGNED),
            ("sd", &self.sd, AMOUNT),
            ("lower", &self.lower, SIGNED),
            ("upper", &self.upper, SIGNED),
        ];
        columns.into_iter().try_for_each(|(name, values, allowed)| {
            table.length(name, inputs, values.len())?;
            table.numbers(name, values, allowed)
        })
    }
}

impl ProcessParams {
    /// Checks a process that may use inputs in the given range, and whose first input must be `first`, if given.
    fn validate(
        &self,
        table: &Table,
        (inputs, first): (Range<usize>, Option<usize>),
        rows: usize,
    ) -> Result<(), FieldError> {
        check!(table, self; sd_scale: FACTOR, mean: SIGNED, sd: AMOUNT, least_sd: AMOUNT, noise_sd: AMOUNT)?;
        let mut missing = vec![true; inputs.end];
        for (index, input) in self.inputs.iter().enumerate() {
            let is_new = inputs.contains(input) && missing.get_mut(*input).is_some_and(std::mem::take);
            if !is_new || (index == 0 && first.is_some_and(|first| first != *input)) {
                let expected = format!("each of {} to {} once at most, in order", inputs.start, inputs.end - 1);
                return Err(table.wrong(&format!("inputs[{index}]"), expected, input));
            }
        }
        if self.inputs.is_empty() {
            return Err(table.wrong("inputs", "1 entry or more", 0));
        }
        table.length("lengths", self.inputs.len(), self.lengths.len())?;
        table.numbers("lengths", &self.lengths, FACTOR)?;
        table.length("weights", rows, self.weights.len())?;
        table.numbers("weights", &self.weights, WEIGHT)?;
        let side = side_of(self.explained.len());
        if side * (side + 1) / 2 != self.explained.len() || side > INDUCING.min(rows) {
            let expected = format!("m (m + 1)/2 entries, m up to {}", INDUCING.min(rows));
            return Err(table.wrong("explained", expected, self.explained.len()));
        }
        table.numbers("explained", &self.explained, WEIGHT)
    }
}

impl TrainingRow {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number outside its range.
    pub fn validate(&self, table: &Table) -> Result<(), FieldError> {
        check!(table, self; time_s: SIGNED, strain: SIGNED)?;
        table.numbers("past", &self.past, SIGNED)?;
        table.numbers("future", &self.future, SIGNED)?;
        table.numbers("filtered", &self.filtered, SIGNED)?;
        table.numbers("smoothed", &self.smoothed, SIGNED)
    }
}
