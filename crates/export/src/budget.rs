//! The best filter that a chip has room for.

use std::str::FromStr;

use ohmstrain_sensor::{EstimatorKind, SensorParams};

use super::ExportError;
use super::boards::Board;
use super::cost::{Cost, Processor, cost_of};
use super::plan::{ChipFilter, Plan};
use super::reduced::Rows;

/// Largest cost of a filter, on a Cortex-M4F or on a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    board: Option<&'static Board>,
    instructions: Option<usize>,
    flash: Option<usize>,
    ram: Option<usize>,
}

/// Room for a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Instructions a step.
    pub instructions: usize,
    /// Flash, bytes.
    pub flash: usize,
    /// RAM, the stack included, bytes.
    pub ram: usize,
}

/// Instructions a step of a `lean` filter: 100 steps a second are a tenth of a processor of 16 MHz.
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
    /// The board, if it is one's.
    pub const fn board(&self) -> Option<&'static Board> {
        self.board
    }

    /// Processor on which costs are compared.
    fn processor(&self) -> Processor {
        self.board.map_or(Processor::Single, |board| board.processor)
    }

    /// Room for a filter whose readings come every `dt_s` seconds. A number that is given stands before the board's.
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

    /// Cost of a plan where the budget is compared with it: on the board, or on a Cortex-M4F.
    ///
    /// # Errors
    /// If the sensor has no exported form.
    pub fn cost(&self, params: &SensorParams, plan: &Plan, dt_s: f64) -> Result<Cost, ExportError> {
        let chip = ChipFilter::new(params, plan)?;
        Ok(cost_of(params, &chip, dt_s)?.on(self.processor(), &params.law, &chip))
    }
}

impl Room {
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
    let room = budget.room(dt_s);
    for plan in plans(params) {
        let cost = budget.cost(params, &plan, dt_s)?;
        if room.allows(&cost) {
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
    use super::{Board, Budget, LEAN, Room};

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
    fn an_unknown_board_is_answered_with_all_names() {
        let error = "board=duo".parse::<Budget>().unwrap_err();
        assert_eq!(
            error,
            "no board is called duo; boards: uno, nano, nano33, nano33ble, teensy40, esp32, esp32c3, rp2040, stm32f1, \
             stm32f4, stm32l4"
        );
    }
}
