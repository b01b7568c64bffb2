//! Errors and costs that an exported filter promises.

use comfy_table::{Table, presets};
use ohmstrain_sensor::{Scores, SensorParams};

use crate::cost::cost_of;
use crate::{Budget, ChipFilter, Cost, ExportError, Plan};

/// Scores on a recording: of the exported filter, of the sensor's filter on this computer, and of a static cubic.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// The exported filter.
    pub exported: Scores,
    /// The sensor's filter.
    pub computer: Scores,
    /// A static cubic.
    pub static_cubic: Scores,
}

/// Errors and costs of an exported filter.
#[derive(Clone, Debug)]
pub struct Promise {
    /// A table of errors and costs, for the header of the exported code, too.
    pub lines: Vec<String>,
    /// Description of the part of the filter that is exported, and of its interval.
    pub words: String,
    /// Cost on a Cortex-M4F.
    pub cost: Cost,
}

impl Promise {
    /// Collects errors and costs of a plan for readings every `dt_s` seconds, also on a recording and on the board of a budget,
    /// if given.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn new(
        params: &SensorParams,
        plan: &Plan,
        dt_s: f64,
        compared: Option<&Compared>,
        budget: Option<&Budget>,
    ) -> Result<Self, ExportError> {
        let chip = ChipFilter::new(params, plan)?;
        let cost = cost_of(params, &chip, dt_s)?;
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_header(["estimate", "%FS", "50/90/95 %", "instructions", "flash, B", "RAM, B", "of it stack, B"]);
        let is_default = plan.kind.is_none_or(|kind| kind == params.default_estimator) && !chip.is_smaller();
        for (name, errors) in errors(params, is_default) {
            table.add_row([name].into_iter().chain(errors));
        }
        let mut exported = [String::new(), String::new()];
        if let Some(compared) = compared {
            table.add_row(["static cubic".to_owned()].into_iter().chain(of_all(&compared.static_cubic)));
            table.add_row(["this computer".to_owned()].into_iter().chain(of_all(&compared.computer)));
            exported = of_all(&compared.exported);
        }
        table.add_row(["exported".to_owned()].into_iter().chain(exported).chain(of_cost(&cost)));
        if let Some((budget, board)) = budget.and_then(|budget| Some((budget, budget.board()?))) {
            let mut add = |name: String, costs: &[String]| {
                table.add_row([name, String::new(), String::new()].iter().chain(costs));
            };
            add(format!("on {}", board.title), &of_cost(&budget.cost(params, plan, dt_s)?));
            let room = budget.room(dt_s);
            let most = [room.instructions, room.flash, room.ram].map(|number| number.to_string());
            add("room for it there".to_owned(), &most);
        }
        let words = format!("{}; a reading every {dt_s} s", chip.words());
        Ok(Self { lines: table.lines().collect(), words, cost })
    }
}

/// Returns the errors found in calibration, of the filter or of the sensor's default one, and of a static cubic.
fn errors(params: &SensorParams, is_default: bool) -> Vec<(String, [String; 2])> {
    let whose = if is_default { "" } else { " of the default" };
    let of_95 = |error: f64, percent: f64| [format!("{error:.2}"), format!("-/-/{percent:.0}")];
    let alone = |error: f64| [format!("{error:.2}"), String::new()];
    let mut rows = Vec::new();
    if let Some(summary) = &params.summary {
        let promised = of_95(summary.left_out_percent_fs, summary.coverage_95_percent);
        rows.push((format!("promised{whose}: left out"), promised));
        rows.push(("static cubic: left out".to_owned(), alone(summary.static_cubic_percent_fs)));
    }
    if let Some(tested) = &params.tested {
        let kept = of_95(tested.filter_percent_fs, tested.coverage_95_percent);
        rows.push((format!("tested{whose}: rows kept from calibration"), kept));
        rows.push(("static cubic: these rows".to_owned(), alone(tested.static_cubic_percent_fs)));
    }
    rows
}

/// Formats the error, percent of full scale, and the coverages, percent; no coverages without an interval.
fn of_all(scores: &Scores) -> [String; 2] {
    let shares = [scores.coverage_50, scores.coverage_90, scores.coverage_95];
    let known: Vec<String> = shares.into_iter().flatten().map(|share| format!("{:.0}", 100.0 * share)).collect();
    [format!("{:.2}", scores.rmse_percent_fs), known.join("/")]
}

fn of_cost(cost: &Cost) -> [String; 4] {
    [cost.instructions, cost.flash, cost.ram(), cost.stack].map(|number| number.to_string())
}
