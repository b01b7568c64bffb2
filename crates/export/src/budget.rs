//! The best filter that fits a chip.

use std::str::FromStr;

use ohmstrain_sensor::{EstimatorKind, SensorParams};

use super::boards::Board;
use super::cost::{Cost, Processor, cost_of};
use super::plan::{ChipFilter, Plan};
use super::reduced::RowBudget;
use super::{ExportError, FILTERS};

/// Largest permitted cost of a filter, on a Cortex-M4F or on a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    board: Option<&'static Board>,
    instructions: Option<usize>,
    flash: Option<usize>,
    ram: Option<usize>,
}

/// Resources available to a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Instructions per step.
    pub instructions: usize,
    /// Flash, bytes.
    pub flash: usize,
    /// RAM, stack included, bytes.
    pub ram: usize,
}

/// Instructions per step of a `lean` filter: at 100 steps per second it uses a tenth of a 16 MHz processor.
const LEAN: usize = 15_000;

fn expected() -> String {
    format!("expected lean, or some of board=NAME,instructions=N,flash=BYTES,ram=BYTES; boards: {}", Board::names())
}

impl FromStr for Budget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut budget = Self::default();
        if text == "lean" {
            return Ok(Self { instructions: Some(LEAN), ..budget });
        }
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(expected)?;
            if name == "board" {
                let unknown = || format!("no board is called {value}; boards: {}", Board::names());
                budget.board = Some(Board::named(value).ok_or_else(unknown)?);
                continue;
            }
            let number = value.parse().map_err(|_| format!("{}; {value} is no whole number", expected()))?;
            match name {
                "instructions" => budget.instructions = Some(number),
                "flash" => budget.flash = Some(number),
                "ram" => budget.ram = Some(number),
                _ => return Err(expected()),
            }
        }
        Ok(budget)
    }
}

impl Budget {
    /// Returns the board, if the budget names one.
    pub const fn board(&self) -> Option<&'static Board> {
        self.board
    }

    /// Returns the processor on which costs are compared.
    fn processor(&self) -> Processor {
        self.board.map_or(Processor::Single, |board| board.processor)
    }

    /// Returns the room for a filter with readings every `dt_s` seconds. An explicit number overrides the board's.
    pub fn room(&self, dt_s: f64) -> Room {
        let of_board = self.board.map(|board| Room {
            instructions: board.instructions(dt_s),
            flash: board.flash_for_filter(),
            ram: board.ram_for_filter(),
        });
        let most = of_board.unwrap_or(Room { instructions: usize::MAX, flash: usize::MAX, ram: usize::MAX });
        Room {
            instructions: self.instructions.unwrap_or(most.instructions),
            flash: self.flash.unwrap_or(most.flash),
            ram: self.ram.unwrap_or(most.ram),
        }
    }

    /// Computes the cost of a plan on the budget's processor: the board's, or a Cortex-M4F.
    ///
    /// # Errors
    /// If the sensor has no exported form.
    pub fn cost(&self, params: &SensorParams, plan: &Plan, dt_s: f64) -> Result<Cost, ExportError> {
        let chip = ChipFilter::new(params, plan)?;
        Ok(cost_of(params, &chip, dt_s)?.on(self.processor(), &params.law, &chip))
    }
}

impl Room {
    /// Names the resource that a filter exceeds; `None` if it fits.
    fn lacks(&self, cost: &Cost) -> Option<String> {
        let all = [
            (cost.instructions, self.instructions, "instructions"),
            (cost.flash, self.flash, "B of flash"),
            (cost.ram(), self.ram, "B of RAM"),
        ];
        let lacking = all.iter().filter(|(takes, has, _)| takes > has);
        let words: Vec<String> =
            lacking.map(|(takes, has, what)| format!("{takes} {what} where {has} are free")).collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

/// A plan compared with a budget.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The plan.
    pub plan: Plan,
    /// The plan in words.
    pub words: String,
    /// Cost on the budget's processor.
    pub cost: Cost,
    /// Resource that it exceeds; `None` if it fits.
    pub lacks: Option<String>,
}

/// Part of the correction that is kept.
#[derive(Clone, Copy)]
enum Left {
    All,
    Some(RowBudget),
    None,
}

/// Numbers of hypotheses and kept parts of the correction, in the order in which they are preferred. docs/chip.md compares it with
/// measured errors.
const ORDER: [(usize, Left); 18] = [
    (8, Left::All),
    (8, rows(48, 32)),
    (8, rows(32, 16)),
    (4, Left::All),
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
    Left::Some(RowBudget { mean, variance })
}

/// Returns the plans of a sensor's default filter, the best by the table first, each with the resource that it exceeds.
///
/// # Errors
/// If the sensor has no exported form, or nothing fits.
pub fn candidates(params: &SensorParams, budget: &Budget, dt_s: f64) -> Result<Vec<Candidate>, ExportError> {
    let room = budget.room(dt_s);
    let mut all = Vec::new();
    for plan in plans(params) {
        let chip = ChipFilter::new(params, &plan)?;
        let cost = cost_of(params, &chip, dt_s)?.on(budget.processor(), &params.law, &chip);
        all.push(Candidate { plan, words: chip.words(), cost, lacks: room.lacks(&cost) });
    }
    let smallest = all.iter().min_by_key(|candidate| candidate.cost.instructions);
    match smallest {
        Some(Candidate { cost, lacks: Some(lacks), .. }) if all.iter().all(|candidate| candidate.lacks.is_some()) => {
            Err(ExportError::Budget { least: *cost, lacks: lacks.clone() })
        }
        _ => Ok(all),
    }
}

/// Returns the first of [`candidates`] that fits.
///
/// # Errors
/// If the sensor has no exported form, or nothing fits.
pub fn first_fitting(params: &SensorParams, budget: &Budget, dt_s: f64) -> Result<Plan, ExportError> {
    let fits = candidates(params, budget, dt_s)?.into_iter().find(|candidate| candidate.lacks.is_none());
    Ok(fits.map_or_else(Plan::default, |candidate| candidate.plan))
}

/// Returns the plans of a sensor's default filter, the best first.
fn plans(params: &SensorParams) -> Vec<Plan> {
    if params.default_estimator == EstimatorKind::StaticCubic {
        return vec![Plan::default()];
    }
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
    let is_exported = FILTERS.contains(&kind);
    let is_there = |(_, left): &(usize, Left)| is_corrected || matches!(left, Left::None);
    let mut plans: Vec<Plan> = ORDER.into_iter().filter(|left| is_exported && is_there(left)).map(of).collect();
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
    use super::{Board, Budget, Cost, LEAN, Room};

    #[test]
    fn a_budget_is_lean_or_a_list_of_numbers_and_a_board() {
        let budget = |instructions, flash, ram| Ok(Budget { board: None, instructions, flash, ram });
        assert_eq!("lean".parse(), budget(Some(LEAN), None, None));
        assert_eq!("flash=32768,ram=2048".parse(), budget(None, Some(32768), Some(2048)));
        let uno = Budget { board: Board::named("uno"), ..Budget::default() };
        assert_eq!("board=uno".parse(), Ok(uno));
        assert_eq!("board=uno,ram=900".parse(), Ok(Budget { ram: Some(900), ..uno }));
        for text in ["", "fat", "flash", "flash=1.5", "flash=-1", "speed=3", "ram=1,,", "uno"] {
            assert!(text.parse::<Budget>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_board_and_an_interval_are_room_and_a_number_stands_before_it() {
        let room = |text: &str| text.parse::<Budget>().unwrap().room(0.02);
        assert_eq!(room("board=uno"), Room { instructions: 160_000, flash: 24_192, ram: 1536 });
        assert_eq!(room("board=uno,flash=20000").flash, 20_000);
        assert_eq!(room("lean"), Room { instructions: LEAN, flash: usize::MAX, ram: usize::MAX });
    }

    #[test]
    fn what_does_not_fit_says_what_there_is_too_little_of() {
        let room = "board=uno".parse::<Budget>().unwrap().room(0.02);
        let cost = |instructions, flash| Cost { instructions, flash, state: 200, stack: 1000 };
        assert_eq!(room.lacks(&cost(160_000, 24_192)), None);
        let lacks = room.lacks(&cost(160_001, 30_000));
        let expected = "160001 instructions where 160000 are free, 30000 B of flash where 24192 are free";
        assert_eq!(lacks.as_deref(), Some(expected));
    }

    #[test]
    fn an_unknown_board_is_answered_with_all_names() {
        let error = "board=duo".parse::<Budget>().unwrap_err();
        assert_eq!(
            error,
            "no board is called duo; boards: uno, nano, nano33, nano33ble, teensy40, esp32, esp32c3, rp2040, stm32f1, \
             stm32f4, stm32l4"
        );
    }
}
