use crate::kernel::Several;

/// Number of rows side by side: the lanes of the vectors that [`Correction`](super::Correction) computes in.
pub const BLOCK: usize = 4;

/// Rows side by side: each of D inputs of [`BLOCK`] rows. A last block may have fewer; what is in their places does not count.
pub type RowBlock<T, const D: usize> = [[T; BLOCK]; D];

/// Standardised inputs of rows, in blocks; they may lie in flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRows<'a, T, const D: usize> {
    blocks: &'a [RowBlock<T, D>],
    count: usize,
}

impl<'a, T, const D: usize> InputRows<'a, T, D> {
    /// The first `count` rows of blocks; all of them if there are fewer.
    #[must_use]
    pub const fn new(blocks: &'a [RowBlock<T, D>], count: usize) -> Self {
        Self { blocks, count }
    }

    /// Calls `see` with the rows, as many at a time as there are lanes.
    #[inline(always)]
    pub(super) fn side_by_side<V: Several<Number = T>>(self, like: V, mut see: impl FnMut(SideBySide<'a, V, D>)) {
        let mut left = self.count;
        for block in self.blocks {
            // Of a block that fills a vector the compiler knows that this goes once, from 0 on.
            let mut from = 0;
            while from < BLOCK && left > 0 {
                let count = left.min(V::WIDTH);
                see(SideBySide { like, block, from, count });
                left -= count;
                from += V::WIDTH;
            }
        }
    }
}

/// Rows in the lanes of a vector.
pub(super) struct SideBySide<'a, V: Several, const D: usize> {
    like: V,
    block: &'a RowBlock<V::Number, D>,
    from: usize,
    pub count: usize,
}

impl<V: Several, const D: usize> SideBySide<'_, V, D> {
    /// An input of all of them.
    #[inline(always)]
    pub(super) fn column(&self, i: usize) -> V {
        self.like.first_of(self.block.get(i).and_then(|inputs| inputs.get(self.from..)).unwrap_or(&[]))
    }

    /// Squares of how far they are in an input from `x`.
    #[inline(always)]
    pub(super) fn squares(&self, i: usize, x: V::Number) -> V {
        let apart = self.like.with(x) - self.column(i);
        apart * apart
    }
}

/// The block that a list of rows begins with; `None` if there are none. Where they are fewer than [`BLOCK`] the first one fills up.
#[must_use]
pub fn block_of<T: Copy, const D: usize>(rows: &[[T; D]]) -> Option<RowBlock<T, D>> {
    let first = rows.first()?;
    Some(core::array::from_fn(|i| core::array::from_fn(|lane| rows.get(lane).unwrap_or(first)[i])))
}
