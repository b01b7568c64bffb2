use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::Fault;
use super::readings::uniform;
use crate::simulate::normal;
use crate::trace::Trace;

/// Largest displacement of a row's time, as a fraction of the step to its neighbour.
const NEAREST: f64 = 0.45;

/// Changes the times, or the order, of some rows.
pub(super) fn put_into(trace: &mut Trace, rows: Range<usize>, fault: Fault, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    match fault {
        Fault::Jitter { share } => jitter(&mut trace.time_s, rows, share, &mut random),
        Fault::WrongRate { factor } => {
            let from = rows.start;
            let Some(&start_s) = trace.time_s.get(from) else { return };
            let end_s = trace.time_s[rows.end - 1];
            let ahead_s = (factor - 1.0) * (end_s - start_s);
            let (inside, after) = trace.time_s[from..].split_at_mut(rows.len());
            inside.iter_mut().for_each(|time_s| *time_s = start_s + factor * (*time_s - start_s));
            after.iter_mut().for_each(|time_s| *time_s += ahead_s);
        }
        Fault::Duplicated { share } => {
            let twice = |row: usize, random: &mut ChaCha8Rng| rows.contains(&row) && uniform(random) < share;
            let order: Vec<usize> = (0..trace.len())
                .flat_map(|row| std::iter::repeat_n(row, if twice(row, &mut random) { 2 } else { 1 }))
                .collect();
            *trace = trace.picked(order.into_iter());
        }
        Fault::Late { share } => {
            let mut order: Vec<usize> = (0..trace.len()).collect();
            let mut row = rows.start;
            while row + 1 < rows.end {
                if uniform(&mut random) < share {
                    order.swap(row, row + 1);
                    row += 1;
                }
                row += 1;
            }
            *trace = trace.picked(order.into_iter());
        }
        _ => {}
    }
}

fn jitter(time_s: &mut [f64], rows: Range<usize>, share: f64, random: &mut ChaCha8Rng) {
    let exact = time_s.to_vec();
    for row in rows {
        let after = exact.get(row + 1).map(|next| next - exact[row]);
        let before = row.checked_sub(1).map(|last| exact[row] - exact[last]);
        let (Some(after), Some(before)) = (after.or(before), before.or(after)) else { return };
        let off = share * normal(random) * after.min(before);
        time_s[row] = exact[row] + off.clamp(-NEAREST * before, NEAREST * after);
    }
}
