//! Coverage and error of every filter on its own law against the length of a step. Prints `docs/sampling-rates.md`:
//!
//! ```text
//! cargo run --release -p ohmstrain-tests --example sampling_rates > docs/sampling-rates.md
//! ```

use comfy_table::{Table, presets};
use ohmstrain_ekf::{
    Belief, Ekf, Estimator, Hypotheses, Imm, Mixture, Phased, SignSplit, StrainSensor, Ukf, Unscented,
};
use ohmstrain_model::{Phase, SwitchedModel};
use ohmstrain_tests::own_law::{EVIDENCE, Moves, dwell, honesty, three_states, two_states};

const STEPS_S: [f64; 6] = [0.004, 0.02, 0.05, 0.1, 0.2, 0.5];
const RECORDINGS: u64 = 24;

fn main() {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let steps = STEPS_S.map(|dt_s| format!("{dt_s} s"));
    table.set_header(["filter".into(), "motion".into(), String::new()].into_iter().chain(steps));
    for moves in [Moves::Ou, Moves::OuAndHolds] {
        of::<2, 5, 15>(&mut table, two_states(moves), moves);
    }
    of::<3, 6, 21>(&mut table, three_states(), Moves::Smooth);
    let (model, moves) = (two_states(Moves::Phases), Moves::Phases);
    let start = Mixture::single(Belief::<f64, 5, 15>::initial(&model), Phase::Extend);
    row::<_, 5, 15>(&mut table, "IMM", Imm::new(model, dwell(moves), EVIDENCE), &start, moves);
    let start = Mixture::single(Belief::<f64, 5, 15>::initial(&model), Phase::Extend);
    row::<_, 5, 15>(
        &mut table,
        "phase histories (16)",
        Hypotheses::<_, _, 16>::new(model, dwell(moves), EVIDENCE),
        &start,
        moves,
    );
    println!("{}\n\n{table}", include_str!("sampling_rates.md").trim_end());
}

/// The filters that take the direction from the sign of the rate. Those of one Gaussian know no holds.
fn of<const M: usize, const N: usize, const L: usize>(
    table: &mut Table,
    model: SwitchedModel<f64, M, 2, N>,
    moves: Moves,
) where
    SwitchedModel<f64, M, 2, N>: Phased<f64, N, L> + StrainSensor<f64, M, 2, N>,
{
    let start: Belief<f64, N, L> = Belief::initial(&model);
    let rests = moves == Moves::OuAndHolds;
    if !rests {
        row::<_, N, L>(table, "EKF", Ekf::new(model), &start, moves);
        row::<_, N, L>(table, "UKF", Ukf::new(Unscented::new(model)), &start, moves);
    }
    let split = SignSplit::<_, _, 8>::new(model, rests.then(|| dwell(moves)), EVIDENCE);
    row::<_, N, L>(table, "sign-split (8)", split, &Mixture::single(start, Phase::Extend), moves);
}

fn row<E, const N: usize, const L: usize>(table: &mut Table, name: &str, estimator: E, start: &E::State, moves: Moves)
where
    E: Estimator<f64, N, L> + Copy,
{
    let motion = match moves {
        Moves::Ou => "OU",
        Moves::OuAndHolds => "OU and holds",
        Moves::Smooth => "smooth",
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
