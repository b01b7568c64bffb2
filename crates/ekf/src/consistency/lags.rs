use ohmstrain_model::Scalar;

/// A sum that does not lose small terms, however many were added: in `f32` a plain one stops counting at 2²⁴.
///
/// Source: Neumaier, *Z. angew. Math. Mech.* 54 (1974) 39.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sum<T> {
    sum: T,
    lost: T,
}

impl<T: Scalar> Sum<T> {
    pub(crate) fn zero() -> Self {
        Self { sum: T::zero(), lost: T::zero() }
    }

    pub(crate) fn add(&mut self, term: T) {
        let sum = self.sum + term;
        let (large, small) = if self.sum.abs() >= term.abs() { (self.sum, term) } else { (term, self.sum) };
        self.lost += (large - sum) + small;
        self.sum = sum;
    }

    pub(crate) fn value(&self) -> T {
        self.sum + self.lost
    }
}

/// Sums of products of a sequence with itself 1 to `H` places earlier, gaps left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lags<T, const H: usize> {
    /// A ring; `next` is the oldest, to be overwritten.
    recent: [Option<T>; H],
    next: usize,
    products: [Sum<T>; H],
    pairs: [usize; H],
}

impl<T: Scalar, const H: usize> Lags<T, H> {
    const HAS_LAGS: () = assert!(H > 0, "there must be a lag to compare at");

    pub(crate) fn new() -> Self {
        let () = Self::HAS_LAGS;
        Self { recent: [None; H], next: 0, products: [Sum::zero(); H], pairs: [0; H] }
    }

    /// The next number of the sequence, or a gap in it.
    pub(crate) fn push(&mut self, number: Option<T>) {
        if let Some(number) = number {
            for lag in 1..=H {
                if let Some(earlier) = self.recent[(self.next + H - lag) % H] {
                    self.products[lag - 1].add(number * earlier);
                    self.pairs[lag - 1] += 1;
                }
            }
        }
        self.recent[self.next] = number;
        self.next = (self.next + 1) % H;
    }

    /// Ljung and Box's statistic `n (n + 2) Σ r²/pairs` of n numbers with mean zero and a given sum of squares, and the
    /// number of lags that had pairs; `None` if none had.
    ///
    /// With pairs = n - lag it is theirs. With gaps it keeps its mean: n numbers in a random direction have
    /// E r² = pairs / (n (n + 2)) at any pattern of gaps.
    pub(crate) fn ljung_box(&self, squares: T, count: usize) -> Option<(T, usize)> {
        let n = T::of(count as f64);
        let (mut statistic, mut lags) = (T::zero(), 0);
        for (product, &pairs) in self.products.iter().zip(&self.pairs) {
            if pairs > 0 && squares > T::zero() {
                let r = product.value() / squares;
                statistic += n * (n + T::of(2.0)) * r * r / T::of(pairs as f64);
                lags += 1;
            }
        }
        (lags > 0).then_some((statistic, lags))
    }
}
