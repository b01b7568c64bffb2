//! Coverage and error of every filter on its own law against the length of a step. Prints `docs/sampling-rates.md`:
//!
//! ```text
//! cargo run --release -p ohmstrain-tests --example sampling_rates > docs/sampling-rates.md
//! ```

use comfy_table::{Table, presets};
use ohmstrain_ekf::{Belief, Ekf, Estimator, Hypotheses, Imm, Mixture, PhaseMixture, SignSplit};
use ohmstrain_model::{Phase, SwitchedModel};
use ohmstrain_tests::own_law::{EVIDENCE, Moves, dwell, honesty, sensor};

const STEPS_S: [f64; 6] = [0.004, 0.02, 0.05, 0.1, 0.2, 0.5];
const RECORDINGS: u64 = 24;

fn main() {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let steps = STEPS_S.map(|dt_s| format!("{dt_s} s"));
    table.set_header(["filter".into(), "motion".into(), String::new()].into_iter().chain(steps));
    for moves in [Moves::Ou, Moves::OuAndHolds] {
        of(&mut table, sensor(moves), moves);
    }
    let (model, moves) = (sensor(Moves::Phases), Moves::Phases);
    let start = PhaseMixture::single(Belief::<f64, 5, 15>::initial(&model), Phase::Extend);
    let imm = Imm::<_, 2, 5>::new(model, 0.0, dwell(moves), EVIDENCE).expect("no step is refused");
    row::<_, 5, 15>(&mut table, "IMM", imm, &start, moves);
    let start = Mixture::single(Belief::<f64, 5, 15>::initial(&model), Phase::Extend);
    let histories = Hypotheses::<_, 2, 5, 16>::new(model, 0.0, dwell(moves), EVIDENCE).expect("no step is refused");
    row::<_, 5, 15>(&mut table, "phase histories (16)", histories, &start, moves);
    println!("{}\n\n{table}", include_str!("sampling_rates.md").trim_end());
}

/// The filters that take the direction from the sign of the rate. Those of one Gaussian know no holds.
fn of(table: &mut Table, model: SwitchedModel<f64, 2, 5>, moves: Moves) {
    let start: Belief<f64, 5, 15> = Belief::initial(&model);
    let rests = moves == Moves::OuAndHolds;
    if !rests {
        row::<_, 5, 15>(table, "EKF", Ekf::new(model), &start, moves);
    }
    let split =
        SignSplit::<_, 2, 5, 8>::new(model, 0.0, rests.then(|| dwell(moves)), EVIDENCE).expect("no step is refused");
    row::<_, 5, 15>(table, "sign-split (8)", split, &Mixture::single(start, Phase::Extend), moves);
}

fn row<E, const N: usize, const L: usize>(table: &mut Table, name: &str, estimator: E, start: &E::State, moves: Moves)
where
    E: Estimator<f64, N, L> + Copy,
{
    let motion = match moves {
        Moves::Ou => "OU",
        Moves::OuAndHolds => "OU and holds",
        Moves::Phases => "phases",
    };
    for third_missing in [false, true] {
        let cells = STEPS_S.map(|dt_s| {
            let found = honesty::<_, N, L>(estimator, start, (moves, dt_s, third_missing), 0..RECORDINGS);
            format!("{:.0} % ({:.1} ± {:.1})", found.coverage(), 1e3 * found.rmse(), 1e3 * found.stated_sd())
        });
        let readings = if third_missing { "⅔" } else { "all" };
        table.add_row([name.into(), motion.into(), readings.into()].into_iter().chain(cells));
    }
}
