//! A protocol for a person: each position from below and from above, at several paces, with long and short holds.

use ohmstrain_bench_data::pacing::{MOST_STEPS, PacedStep, Pacing};

/// Duration of the rest at the beginning and at the end, and of one long hold, s.
const REST_S: f64 = 20.0;
const LONG_S: f64 = 30.0;
/// Durations of moves and of holds, used in turn, s.
const MOVES_S: [f64; 4] = [2.0, 1.0, 3.0, 0.7];
const HOLDS_S: [f64; 3] = [4.0, 8.0, 3.0];

/// Returns steps through the positions of `pacing`, the first of which is the rest, that fill `minutes`.
pub fn steps(pacing: &Pacing, minutes: f64) -> Vec<PacedStep> {
    let last = pacing.positions.len() - 1;
    let mut steps = vec![PacedStep { to: 0, move_s: 0.0, hold_s: REST_S }];
    let (mut moves, mut holds) = (MOVES_S.iter().cycle(), HOLDS_S.iter().cycle());
    let mut elapsed_s = 2.0 * REST_S;
    // Up and down in one move each, then from position to position: each position is reached with different histories.
    let round = [last, 0].into_iter().chain(1..=last).chain((0..last).rev());
    for (k, to) in round.cycle().enumerate() {
        let is_there = steps.last().is_some_and(|step| step.to == to);
        let (Some(move_s), Some(hold_s)) = (moves.next(), holds.next()) else { break };
        if is_there {
            continue;
        }
        let hold_s = if k == 0 { LONG_S } else { *hold_s };
        let step = PacedStep { to, move_s: *move_s, hold_s };
        elapsed_s += step.duration_s();
        // More than the most are refused later.
        if steps.len() > MOST_STEPS || (elapsed_s > 60.0 * minutes && steps.len() > 2 * last) {
            break;
        }
        steps.push(step);
    }
    let back_s = if steps.last().is_some_and(|step| step.to == 0) { 0.0 } else { MOVES_S[0] };
    if back_s == 0.0 {
        steps.pop();
    }
    steps.push(PacedStep { to: 0, move_s: MOVES_S[0], hold_s: REST_S });
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use ohmstrain_bench_data::ReferenceQuantity;
    use ohmstrain_bench_data::pacing::Position;

    #[test]
    fn every_position_is_reached_from_both_sides() {
        for count in 2..6 {
            let position = |k: usize| Position { name: k.to_string(), values: vec![k as f64], sd: 0.1 };
            let positions: Vec<Position> = (0..count).map(position).collect();
            let mut pacing = Pacing { quantity: ReferenceQuantity::Strain, joints: vec![], positions, steps: vec![] };
            pacing.steps = steps(&pacing, 4.0);
            pacing.validate().unwrap();
            let pairs: Vec<(usize, usize)> = pacing.steps.windows(2).map(|pair| (pair[0].to, pair[1].to)).collect();
            assert!(pairs.iter().all(|(from, to)| from != to));
            for to in 1..count - 1 {
                assert!(pairs.contains(&(to - 1, to)) && pairs.contains(&(to + 1, to)));
            }
            assert!((180.0..=260.0).contains(&pacing.duration_s()), "{}", pacing.duration_s());
        }
    }
}
