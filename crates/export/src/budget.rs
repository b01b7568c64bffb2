//! The best filter that a chip has room for.

use std::str::FromStr;

use ohmstrain_sensor::{EstimatorKind, SensorParams};

use super::ExportError;
use super::cost::{Cost, cost};
use super::plan::Plan;
use super::reduced::Rows;

/// Largest cost of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    instructions: usize,
    flash: usize,
    ram: usize,
}

/// Instructions a step of a `lean` filter: 100 steps a second are a tenth of a processor of 16 MHz.
const LEAN: usize = 15_000;

const EXPECTED: &str = "expected lean, or some of instructions=N,flash=BYTES,ram=BYTES";

impl FromStr for Budget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut budget = Self { instructions: usize::MAX, flash: usize::MAX, ram: usize::MAX };
        if text == "lean" {
            return Ok(Self { instructions: LEAN, ..budget });
        }
        for part in text.split(',') {
            let (name, number) = part.split_once('=').ok_or(EXPECTED)?;
            let number: usize = number.parse().map_err(|_| format!("{EXPECTED}; {number} is no whole number"))?;
            match name {
                "instructions" => budget.instructions = number,
                "flash" => budget.flash = number,
                "ram" => budget.ram = number,
                _ => return Err(EXPECTED.to_owned()),
            }
        }
        Ok(budget)
    }
}

impl Budget {
    /// True if a filter costs no more.
    const fn allows(&self, cost: &Cost) -> bool {
        cost.instructions <= self.instructions && cost.flash <= self.flash && cost.ram() <= self.ram
    }
}

/// How much of the correction is left.
#[derive(Clone, Copy)]
enum Left {
    All,
    Some(Rows),
    None,
}

/// Hypotheses and what is left of the correction, in the order of their error: the geometric mean over the cases of
/// docs/chip.md.
const ORDER: [(usize, Left); 18] = [
    (8, Left::All),
    (4, Left::All),
    (8, rows(48, 32)),
    (8, rows(32, 16)),
    (3, Left::All),
    (4, rows(48, 32)),
    (4, rows(32, 16)),
    (8, rows(8, 8)),
    (3, rows(32, 16)),
    (8, Left::None),
    (4, rows(8, 8)),
    (3, rows(8, 8)),
    (2, Left::All),
    (4, Left::None),
    (2, rows(32, 16)),
    (3, Left::None),
    (2, rows(8, 8)),
    (2, Left::None),
];

const fn rows(mean: usize, variance: usize) -> Left {
    Left::Some(Rows { mean, variance })
}

/// Plans of a sensor's default that fit, the best by the table first.
///
/// # Errors
/// If the sensor has no exported form, or nothing fits.
pub fn fitting(params: &SensorParams, budget: &Budget, dt_s: f64) -> Result<Vec<Plan>, ExportError> {
    let mut fitting = Vec::new();
    let mut smallest: Option<Cost> = None;
    for plan in plans(params) {
        let cost = cost(params, &plan, dt_s)?;
        if budget.allows(&cost) {
            fitting.push(plan);
        }
        smallest = smallest.filter(|least| least.instructions <= cost.instructions).or(Some(cost));
    }
    match smallest {
        Some(least) if fitting.is_empty() => Err(ExportError::Budget(least)),
        _ => Ok(fitting),
    }
}

/// Plans of a sensor's default, the best first.
fn plans(params: &SensorParams) -> Vec<Plan> {
    let kind = params.filter_of(params.default_estimator);
    let is_corrected = params.default_estimator == EstimatorKind::Corrected;
    let of = |(hypotheses, left): (usize, Left)| {
        let hypotheses = Some(hypotheses);
        match left {
            Left::All => Plan { kind: None, hypotheses, rows: None },
            Left::Some(rows) => Plan { kind: None, hypotheses, rows: Some(rows) },
            Left::None => Plan { kind: Some(kind), hypotheses, rows: None },
        }
    };
    let is_there = |(_, left): &(usize, Left)| is_corrected || matches!(left, Left::None);
    let mut plans: Vec<Plan> = ORDER.into_iter().filter(is_there).map(of).collect();
    if kind == EstimatorKind::Ekf {
        // It has one hypothesis.
        plans.retain(|plan| plan.hypotheses == Some(8));
    } else if params.estimator(EstimatorKind::Ekf).is_ok() {
        plans.push(Plan { kind: Some(EstimatorKind::Ekf), ..Plan::default() });
    }
    plans
}

#[cfg(test)]
mod tests {
    use super::{Budget, LEAN};

    #[test]
    fn a_budget_is_lean_or_a_list_of_numbers() {
        let most = usize::MAX;
        let budget = |instructions, flash, ram| Ok(Budget { instructions, flash, ram });
        assert_eq!("lean".parse(), budget(LEAN, most, most));
        assert_eq!("flash=32768,ram=2048".parse(), budget(most, 32768, 2048));
        for text in ["", "fat", "flash", "flash=1.5", "flash=-1", "speed=3", "ram=1,,"] {
            assert!(text.parse::<Budget>().is_err(), "{text}");
        }
    }
}
