//! Blocks through registers: loads, one step, and what is accepted of it back to memory.

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

use super::kernel::{self, Beliefs};
use super::lane::{Block, Lane, Row};
use super::reading::{self, Compared};
use crate::{Compact, Reading, SparseEkf};

/// Steps all blocks and counts the sensors that were refused.
#[inline(always)]
pub(super) fn step_blocks<T: Lane, S: Simd, const B: usize, const N: usize, const L: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    blocks: &mut [Block<T, N, L>],
    readings: &[T],
    extra: Option<&[T]>,
) -> usize {
    let lanes = 64 / size_of::<T>();
    let (mut values, mut variances) = (T::row(T::of(f64::NAN)), T::row(T::zero()));
    let mut refused = 0;
    for (b, block) in blocks.iter_mut().enumerate() {
        let from = b * lanes;
        let values = filled(readings, from, &mut values);
        let variances = extra.map(|extra| filled(extra, from, &mut variances));
        step_block(simd, ekf, block, values, variances);
        if block.refused != 0 {
            refused += retry(ekf, block, values, variances, readings.len() - from);
        }
    }
    refused
}

/// The numbers of the block that begins `from` a sensor; the last block is filled up with those in `row`.
#[inline(always)]
fn filled<'a, T: Lane>(numbers: &'a [T], from: usize, row: &'a mut Row<T::Row>) -> &'a [T] {
    let row = row.0.as_mut();
    if let Some(whole) = numbers.get(from..from + row.len()) {
        return whole;
    }
    for (place, number) in row.iter_mut().zip(numbers.iter().skip(from)) {
        *place = *number;
    }
    row
}

#[inline(always)]
fn step_block<T: Lane, S: Simd, const B: usize, const N: usize, const L: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    block: &mut Block<T, N, L>,
    values: &[T],
    variances: Option<&[T]>,
) {
    (block.taken, block.refused) = (0, 0);
    let mut from = 0;
    while from < 64 / size_of::<T>() {
        let (present, accepted) = step_vector::<T, S, T::Vector<S>, B, N, L>(simd, ekf, block, values, variances, from);
        block.taken |= (present.to_bitmask() as u32) << from;
        block.refused |= ((!accepted).to_bitmask() as u32) << from;
        from += <T::Vector<S> as SimdBase<S>>::LEN;
    }
}

/// Steps the sensors `from..` of a block; returns who had a reading, and who was accepted.
#[inline(always)]
fn step_vector<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize, const L: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    block: &mut Block<T, N, L>,
    values: &[T],
    variances: Option<&[T]>,
    from: usize,
) -> (V::Mask, V::Mask) {
    let load = |row: &Row<T::Row>| V::from_slice(simd, &row.0.as_ref()[from..from + V::LEN]);
    let store = |row: &mut Row<T::Row>, value: V| value.store_slice(&mut row.0.as_mut()[from..from + V::LEN]);

    let zero = V::splat(simd, T::zero());
    let mut beliefs = Beliefs { mean: [zero; N], covariance: [zero; L] };
    for i in 0..N {
        beliefs.mean[i] = load(&block.mean[i]);
    }
    for i in 0..L {
        beliefs.covariance[i] = load(&block.covariance[i]);
    }
    let spread = kernel::predict(simd, ekf, &mut beliefs);
    let extra = variances.map_or(zero, |variances| V::from_slice(simd, &variances[from..from + V::LEN]));
    let reading = V::from_slice(simd, &values[from..from + V::LEN]);
    let present = reading.simd_eq(reading);
    let Compared { innovation, variance, nis } =
        reading::update(simd, ekf, &mut beliefs, (reading, extra), present, &spread);
    store(&mut block.innovation, innovation);
    store(&mut block.innovation_variance, variance);

    // Whatever is not finite makes this sum not finite, or a comparison false.
    let mut sum = present.select(variance + nis, zero);
    let mut accepted = (variance.simd_gt(T::zero()) & extra.simd_ge(T::zero())) | !present;
    for i in 0..N {
        let variance = beliefs.covariance[kernel::at(i, i)];
        accepted &= variance.simd_ge(T::zero());
        sum += beliefs.mean[i] + variance;
    }
    accepted &= sum.is_finite();
    for i in 0..N {
        let kept = accepted.select(beliefs.mean[i], load(&block.mean[i]));
        store(&mut block.mean[i], kept);
    }
    for i in 0..L {
        let kept = accepted.select(beliefs.covariance[i], load(&block.covariance[i]));
        store(&mut block.covariance[i], kept);
    }
    (present, accepted)
}

/// Steps those that were refused once more, one by one as [`SparseEkf::step`] does: it has a way on for readings that are too
/// exact, and says why it refuses the others. Counts these, among the first `sensors` of a block. Lanes without a sensor
/// never have a reading; what becomes of them concerns nobody.
#[cold]
fn retry<T: Lane, const B: usize, const N: usize, const L: usize>(
    ekf: &SparseEkf<T, Compact, B, N>,
    block: &mut Block<T, N, L>,
    values: &[T],
    variances: Option<&[T]>,
    sensors: usize,
) -> usize {
    let (mut refused, doubted) = (0, block.refused);
    for lane in (0..sensors.min(values.len())).filter(|lane| doubted >> lane & 1 == 1) {
        let extra_variance = variances.map_or(T::zero(), |variances| variances[lane]);
        let reading = (block.taken >> lane & 1 == 1).then_some(Reading { value: values[lane], extra_variance });
        let mut belief = block.belief(lane);
        match ekf.step(&mut belief, reading) {
            Ok(residual) => {
                block.set_belief(lane, &belief);
                block.refused &= !(1 << lane);
                if let Some(residual) = residual {
                    block.innovation.0.as_mut()[lane] = residual.innovation;
                    block.innovation_variance.0.as_mut()[lane] = residual.variance;
                }
            }
            Err(error) => {
                refused += 1;
                block.errors[lane] = error;
            }
        }
    }
    refused
}
