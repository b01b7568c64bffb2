//! Blocks through registers: loads, one step, and what is accepted of it back to memory.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask};

use super::lane::{Block, Lane, Row};
use crate::kernel::{Compared, Course, Lanes, Parts, Vector};
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
    let nothing = Vector { numbers: V::splat(simd, T::zero()), simd };
    let (mut mean, mut covariance) = ([nothing; N], [nothing; L]);
    for i in 0..N {
        mean[i] = load(simd, &block.mean[i], from);
    }
    for i in 0..L {
        covariance[i] = load(simd, &block.covariance[i], from);
    }
    let mut parts = Parts::read::<N>(&mut mean.iter(), &mut covariance.iter(), nothing);
    let spread = ekf.predict(&mut parts, Course::Uncertain);

    let value = Vector { numbers: V::from_slice(simd, &values[from..from + V::LEN]), simd };
    let mut extra_variance = nothing;
    if let Some(variances) = variances {
        extra_variance.numbers = V::from_slice(simd, &variances[from..from + V::LEN]);
    }
    let present = value.numbers.simd_eq(value.numbers);
    let compared = ekf.compare(&parts, Reading { value, extra_variance }, None, spread);
    let nis = SparseEkf::<T, Compact, B, N>::correct(&mut parts, &compared, present);
    let Compared { innovation, variance, .. } = compared;
    store(&mut block.innovation, from, innovation);
    store(&mut block.innovation_variance, from, variance);

    // Without a reading no variance has been looked at yet.
    let said = Vector::pick(present, variance + nis, parts.variances::<N>());
    let sound = parts.is_sound::<N>(said);
    let accepted = sound & ((nothing.less(variance) & extra_variance.not_negative()) | !present);
    parts.write::<N>(&mut mean.iter_mut(), &mut covariance.iter_mut());
    for i in 0..N {
        let old = load(simd, &block.mean[i], from);
        store(&mut block.mean[i], from, Vector::pick(accepted, mean[i], old));
    }
    for i in 0..L {
        let old = load(simd, &block.covariance[i], from);
        store(&mut block.covariance[i], from, Vector::pick(accepted, covariance[i], old));
    }
    (present, accepted)
}

#[inline(always)]
fn load<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, row: &Row<T::Row>, from: usize) -> Vector<V, S> {
    Vector { numbers: V::from_slice(simd, &row.0.as_ref()[from..from + V::LEN]), simd }
}

#[inline(always)]
fn store<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(row: &mut Row<T::Row>, from: usize, vector: Vector<V, S>) {
    vector.numbers.store_slice(&mut row.0.as_mut()[from..from + V::LEN]);
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
