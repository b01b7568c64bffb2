use crate::Recordable;

/// `Σ (lᵢ + Σⱼ≤ᵢ qᵢⱼ xⱼ) xᵢ` of standardised inputs: a cheap approximation of a smooth Gaussian process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadratic<'a, T> {
    /// lᵢ.
    pub linear: &'a [T],
    /// qᵢⱼ, the lower triangle row by row.
    pub square: &'a [T],
}

impl<T: Recordable> Quadratic<'_, T> {
    /// Returns its value, summed in the order of the inputs.
    #[must_use]
    pub fn value(&self, x: &[T]) -> T {
        let mut square = self.square.iter();
        let mut sum = T::zero();
        for (i, (linear, input)) in self.linear.iter().zip(x).enumerate() {
            let slope = square.by_ref().take(i + 1).zip(x).fold(*linear, |slope, (q, other)| slope + *q * *other);
            sum += slope * *input;
        }
        sum
    }
}
