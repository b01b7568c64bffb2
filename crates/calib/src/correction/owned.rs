use std::ops::Deref;

use ohmstrain_ekf::Real;
use ohmstrain_ekf::correction::{
    BLOCK, Correction, InputScale, Process, RowBlock, Rows, Simulated, Triangle, block_of, stripe_places, stripes,
};
use ohmstrain_model::StrainRange;

/// Rows one after another, and the same side by side, as a [`Correction`] wants them.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedRows<T, const D: usize> {
    rows: Vec<[T; D]>,
    blocks: Vec<RowBlock<T, D>>,
}

impl<T: Copy, const D: usize> OwnedRows<T, D> {
    /// The same in blocks.
    pub fn blocks(&self) -> &[RowBlock<T, D>] {
        &self.blocks
    }

    fn as_rows(&self) -> Rows<'_, T, D> {
        Rows::new(&self.blocks, self.rows.len())
    }

    fn map<U: Copy>(&self, number: impl Fn(T) -> U + Copy) -> OwnedRows<U, D> {
        self.rows.iter().map(|row| row.map(number)).collect()
    }
}

impl<T: Copy, const D: usize> FromIterator<[T; D]> for OwnedRows<T, D> {
    fn from_iter<I: IntoIterator<Item = [T; D]>>(rows: I) -> Self {
        let rows: Vec<[T; D]> = rows.into_iter().collect();
        Self { blocks: rows.chunks(BLOCK).filter_map(block_of).collect(), rows }
    }
}

/// One after another.
impl<T, const D: usize> Deref for OwnedRows<T, D> {
    type Target = [[T; D]];

    fn deref(&self) -> &[[T; D]] {
        &self.rows
    }
}

/// A [`Correction`] with everything that it borrows.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedCorrection<T: 'static, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first of them are the inducing rows.
    pub rows: OwnedRows<T, D>,
    /// Scales of the inputs.
    pub scales: [InputScale<T>; D],
    /// Strain from the features.
    pub direct: OwnedProcess<T, D>,
    /// Strain from the features of one side of time.
    pub one_sided: [OwnedProcess<T, D>; S],
    /// What the filter's strain lacks, from all inputs.
    pub residual: OwnedProcess<T, D>,
    /// Strain from the features, by rows of simulated motions.
    pub simulated: Option<OwnedSimulated<T, D>>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance.
    pub variance_factor: T,
}

/// A [`Simulated`] with everything that it borrows.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedSimulated<T: 'static, const D: usize> {
    /// Standardised inputs.
    pub rows: OwnedRows<T, D>,
    /// Scales of the inputs.
    pub scales: [InputScale<T>; D],
    /// What the rows say.
    pub process: OwnedProcess<T, D>,
}

/// A [`Triangle`] with its columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedTriangle<T> {
    columns: Vec<[T; BLOCK]>,
    side: usize,
}

impl<T: Real> OwnedTriangle<T> {
    /// Of the entries on and above the diagonal.
    pub fn new(side: usize, entry: impl Fn(usize, usize) -> T) -> Self {
        Self { columns: stripes(side, entry).collect(), side }
    }

    /// Stripe by stripe.
    pub fn columns(&self) -> &[[T; BLOCK]] {
        &self.columns
    }

    /// How many rows it has.
    pub const fn side(&self) -> usize {
        self.side
    }

    /// The whole matrix, row by row.
    pub fn rows(&self) -> Vec<Vec<T>> {
        let mut rows = vec![vec![T::zero(); self.side]; self.side];
        for ((first, j), column) in stripe_places(self.side).zip(&self.columns) {
            rows[first..].iter_mut().zip(column).for_each(|(row, entry)| row[j] = *entry);
        }
        rows
    }

    fn as_triangle(&self) -> Triangle<'_, T> {
        Triangle::new(&self.columns, self.side)
    }

    fn map<U: Real>(&self, number: impl Fn(T) -> U + Copy) -> OwnedTriangle<U> {
        OwnedTriangle { columns: self.columns.iter().map(|column| column.map(number)).collect(), side: self.side }
    }
}

/// A [`Process`] with everything that it borrows.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedProcess<T: 'static, const D: usize> {
    /// Weight of each training row.
    pub weights: Vec<T>,
    /// What the inducing rows explain.
    pub explained: OwnedTriangle<T>,
    /// Its other numbers.
    pub numbers: Process<'static, T, D>,
}

impl<T: Real + 'static, const D: usize, const S: usize> OwnedCorrection<T, D, S> {
    /// As it runs.
    pub fn correction(&self) -> Correction<'_, T, D, S> {
        Correction {
            rows: self.rows.as_rows(),
            scales: &self.scales,
            direct: self.direct.process(),
            one_sided: self.one_sided.each_ref().map(OwnedProcess::process),
            residual: self.residual.process(),
            simulated: self.simulated.as_ref().map(OwnedSimulated::simulated),
            limits: self.limits,
            strain_variance: self.strain_variance,
            variance_factor: self.variance_factor,
        }
    }

    /// In another precision.
    pub fn map<U: Real + 'static>(&self, number: impl Fn(T) -> U + Copy) -> OwnedCorrection<U, D, S> {
        OwnedCorrection {
            rows: self.rows.map(number),
            scales: in_precision(&self.scales, number),
            direct: self.direct.map(number),
            one_sided: self.one_sided.each_ref().map(|side| side.map(number)),
            residual: self.residual.map(number),
            simulated: self.simulated.as_ref().map(|simulated| simulated.map(number)),
            limits: StrainRange { lower: number(self.limits.lower), upper: number(self.limits.upper) },
            strain_variance: number(self.strain_variance),
            variance_factor: number(self.variance_factor),
        }
    }
}

fn in_precision<T: Copy, U, const D: usize>(
    scales: &[InputScale<T>; D],
    number: impl Fn(T) -> U + Copy,
) -> [InputScale<U>; D] {
    scales.map(|InputScale { mean, sd, lower, upper }| InputScale {
        mean: number(mean),
        sd: number(sd),
        lower: number(lower),
        upper: number(upper),
    })
}

impl<T: Real + 'static, const D: usize> OwnedSimulated<T, D> {
    fn simulated(&self) -> Simulated<'_, T, D> {
        Simulated { rows: self.rows.as_rows(), scales: &self.scales, process: self.process.process() }
    }

    fn map<U: Real + 'static>(&self, number: impl Fn(T) -> U + Copy) -> OwnedSimulated<U, D> {
        OwnedSimulated {
            rows: self.rows.map(number),
            scales: in_precision(&self.scales, number),
            process: self.process.map(number),
        }
    }
}

impl<T: Real + 'static, const D: usize> OwnedProcess<T, D> {
    fn process(&self) -> Process<'_, T, D> {
        Process { weights: &self.weights, explained: self.explained.as_triangle(), ..self.numbers }
    }

    fn map<U: Real + 'static>(&self, number: impl Fn(T) -> U + Copy) -> OwnedProcess<U, D> {
        let Process { relevance, mean, variance, noise, widening, least_variance, .. } = self.numbers;
        OwnedProcess {
            weights: self.weights.iter().copied().map(number).collect(),
            explained: self.explained.map(number),
            numbers: Process {
                relevance: relevance.map(number),
                mean: number(mean),
                weights: &[],
                explained: Triangle::NONE,
                variance: number(variance),
                noise: number(noise),
                widening: number(widening),
                least_variance: number(least_variance),
            },
        }
    }
}
