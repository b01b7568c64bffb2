use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardUniform};

use super::Fault;
use crate::order::extent;
use crate::simulate::normal;

/// Changes the readings of some rows; missing ones stay missing.
pub(super) fn put_into(values: &mut [f64], rows: Range<usize>, fault: Fault, seed: u64) {
    let (low, high) = extent(values.iter().copied().filter(|value| value.is_finite()));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut by_chance = |share: f64| uniform(&mut random) < share;
    let before = values[..rows.start].iter().rev().find(|value| value.is_finite()).copied();
    let first = rows.start;
    let mut noise = ChaCha8Rng::seed_from_u64(seed.wrapping_add(1));
    for (row, value) in values[rows].iter_mut().enumerate() {
        let change = *value - low;
        *value = match fault {
            Fault::Dropout { share } if by_chance(share) => f64::NAN,
            _ if value.is_nan() => f64::NAN,
            Fault::Burst { sd } => *value + sd * low * normal(&mut noise),
            Fault::Spike { factor } if row == 0 => factor * *value,
            Fault::Spikes { share, factor } if by_chance(share) => factor * *value,
            Fault::Stuck if first > 0 => before.unwrap_or(*value),
            Fault::Saturation { share } => value.min(low + share * (high - low)),
            Fault::UnpluggedHigh { reading } | Fault::UnpluggedLow { reading } => reading,
            Fault::BaselineStep { share } => *value + share * low,
            Fault::GainChange { factor } => low + factor * change,
            Fault::PolarityFlip => low - change,
            Fault::WrongRest { factor } => factor * *value,
            _ => *value,
        };
    }
}

/// Draws a uniform number in [0, 1).
pub(super) fn uniform(random: &mut ChaCha8Rng) -> f64 {
    StandardUniform.sample(random)
}
