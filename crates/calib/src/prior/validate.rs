use crate::prior::{CorrectionPrior, EstimatorPrior, FEWEST_SENSORS, LawPrior, Prior, is_covariance};
use ohmstrain_sensor::ranges::{AMOUNT, Allowed, FACTOR, GAIN, POSITIVE, SHARE, SIGNED, Table};
use ohmstrain_sensor::{EstimatorKind, FieldError, MOST_BRANCHES};

/// Allowed logarithms, including that of the stand-in for no speed.
const LOGARITHM: Allowed = Allowed { least: -30.0, most: 30.0 };
/// Allowed number of rows of other sensors; the cost grows with the cube of all rows.
const ROWS: std::ops::RangeInclusive<usize> = 2..=500;
/// Number of weights of a law: three of the gauge, two dash-pots, four per branch.
const WITHOUT_BRANCHES: usize = 5;
const OF_BRANCH: usize = 4;
/// Number of values of a filter's noise and motion, without and with phases.
const SIZES: [usize; 2] = [7, 11];

impl Prior {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first number that is out of range.
    pub fn validate(&self) -> Result<(), FieldError> {
        let root = Table::root();
        if self.sensors < FEWEST_SENSORS {
            return Err(root.wrong("sensors", format!("at least {FEWEST_SENSORS}"), self.sensors));
        }
        self.validity.validate(&root.table("validity"))?;
        self.law.validate(&root.table("law"))?;
        for (kind, estimator) in &self.estimators {
            estimator.validate(&root.table("estimators").table(kind.name()))?;
        }
        self.correction.as_ref().map_or(Ok(()), |correction| correction.validate(&root.table("correction")))
    }
}

impl LawPrior {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        table.range("range", self.range)?;
        table.numbers("tau_s", &self.tau_s, POSITIVE)?;
        table.number("error_density_s", self.error_density_s, POSITIVE)?;
        if self.tau_s.len() > MOST_BRANCHES {
            let expected = format!("at most {} entries", MOST_BRANCHES);
            return Err(table.wrong("tau_s", expected, self.tau_s.len()));
        }
        let size = WITHOUT_BRANCHES + OF_BRANCH * self.tau_s.len();
        table.length("mean", size, self.mean.len())?;
        table.numbers("mean", &self.mean, GAIN)?;
        table.length("covariance", size, self.covariance.len())?;
        for (index, row) in self.covariance.iter().enumerate() {
            let name = format!("covariance[{index}]");
            table.length(&name, size, row.len())?;
            table.numbers(&name, row, SIGNED)?;
        }
        if is_covariance(&self.covariance) {
            return Ok(());
        }
        Err(table.wrong("covariance", "a symmetric matrix that is positive definite", "another"))
    }
}

impl EstimatorPrior {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        if !SIZES.contains(&self.ln_mean.len()) {
            return Err(table.wrong("ln_mean", format!("{} or {} entries", SIZES[0], SIZES[1]), self.ln_mean.len()));
        }
        table.numbers("ln_mean", &self.ln_mean, LOGARITHM)?;
        table.length("ln_sd", self.ln_mean.len(), self.ln_sd.len())?;
        table.numbers("ln_sd", &self.ln_sd, POSITIVE)?;
        table.number("reading_time_s", self.reading_time_s, AMOUNT)?;
        table.number("strain_mean", self.strain_mean, SIGNED)?;
        table.number("reversal", self.reversal, SHARE)?;
        table.number("strain_sd_scale", self.strain_sd_scale, FACTOR)
    }
}

impl CorrectionPrior {
    fn validate(&self, table: &Table) -> Result<(), FieldError> {
        if matches!(self.corrects, EstimatorKind::Corrected | EstimatorKind::StaticCubic) {
            return Err(table.wrong("corrects", "a filter", self.corrects.name()));
        }
        table.scale("readings", &self.readings)?;
        if !ROWS.contains(&self.rows.len()) {
            let expected = format!("{} to {} entries", ROWS.start(), ROWS.end());
            return Err(table.wrong("rows", expected, self.rows.len()));
        }
        self.rows.iter().enumerate().try_for_each(|(index, row)| row.validate(&table.entry("rows", index)))
    }
}
