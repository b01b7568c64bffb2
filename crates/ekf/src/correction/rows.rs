use crate::kernel::Several;

/// Number of rows side by side: the lanes of the vectors that [`Correction`](super::Correction) computes in.
pub const BLOCK: usize = 4;

/// Rows side by side: each of D inputs of [`BLOCK`] rows. The last block may have fewer rows; its other entries are ignored.
pub type RowBlock<T, const D: usize> = [[T; BLOCK]; D];

/// Standardised inputs of rows, in blocks; they may lie in flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRows<'a, T, const D: usize> {
    blocks: &'a [RowBlock<T, D>],
    count: usize,
}

impl<'a, T, const D: usize> InputRows<'a, T, D> {
    /// Takes the first `count` rows of blocks, or all if there are fewer.
    #[must_use]
    pub const fn new(blocks: &'a [RowBlock<T, D>], count: usize) -> Self {
        Self { blocks, count }
    }

    /// Calls `see` with the rows, one vector of lanes at a time.
    #[inline(always)]
    pub(super) fn side_by_side<V: Several<Number = T>>(self, like: V, mut see: impl FnMut(SideBySide<'a, V, D>)) {
        let mut left = self.count;
        for block in self.blocks {
            // For a block that fills a vector, the compiler sees that this loop runs once, from 0.
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
    /// Returns an input of all rows.
    #[inline(always)]
    pub(super) fn column(&self, i: usize) -> V {
        self.like.first_of(self.block.get(i).and_then(|inputs| inputs.get(self.from..)).unwrap_or(&[]))
    }

    /// Returns the squared distances of an input from `x`.
    #[inline(always)]
    pub(super) fn squares(&self, i: usize, x: V::Number) -> V {
        let apart = self.like.with(x) - self.column(i);
        apart * apart
    }
}

/// Returns the block of the first rows of a list; `None` if there are none. If there are fewer than [`BLOCK`], copies of the first
/// row fill it up.
#[must_use]
pub fn block_of<T: Copy, const D: usize>(rows: &[[T; D]]) -> Option<RowBlock<T, D>> {
    let first = rows.first()?;
    Some(core::array::from_fn(|i| core::array::from_fn(|lane| rows.get(lane).unwrap_or(first)[i])))
}
