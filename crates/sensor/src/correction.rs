//! The learned correction in running form: owned versions of the types that borrow in the core, and their construction
//! from a sensor's parameters.

use std::ops::Deref;

use ohmstrain_ekf::Real;
use ohmstrain_ekf::correction::{
    BLOCK, Correction, FEATURES, FILTER_INPUTS, InputRows, InputScale, OUTPUTS, OneSided, Process, RowBlock, Simulated,
    Triangle, block_of, filter_inputs, stripe_places, stripes,
};
use ohmstrain_model::StrainRange;

use crate::params::correction::{CorrectorParams, InputScales, ProcessParams, SimulatedParams};
pub use crate::params::correction::{SIDES, SMOOTHER_INPUTS, smoother_inputs};

/// A process of a correction, by the inputs that it sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessKind {
    /// Features of the readings.
    Direct,
    /// Features of the past.
    Past,
    /// Features of the future: differences of the reading from its low-passes, and rates, but not the reading itself. An error of
    /// R₀ shifts the reading, but only scales these features.
    Future,
    /// Outputs of the filter, and features.
    Residual,
}

/// Direct processes of one side of time, in the order of the parameters.
pub const ONE_SIDED: [ProcessKind; SIDES] = [ProcessKind::Past, ProcessKind::Future];

/// Index of the reading's difference from the slowest low-pass of the future.
const SLOWEST_OF_FUTURE: usize = OUTPUTS + FEATURES + 3;

impl ProcessKind {
    /// Returns the indices, among the `inputs` of a correction, of those that the process uses. The linear part of its
    /// kernel takes the first.
    #[must_use]
    pub fn places(self, inputs: usize) -> Vec<usize> {
        match self {
            Self::Direct => (OUTPUTS..inputs).collect(),
            Self::Past => (OUTPUTS..OUTPUTS + FEATURES).collect(),
            Self::Future => {
                let others = (OUTPUTS + FEATURES..inputs).filter(|place| *place != SLOWEST_OF_FUTURE);
                std::iter::once(SLOWEST_OF_FUTURE).chain(others).collect()
            }
            Self::Residual => (0..inputs).collect(),
        }
    }
}

/// Relevance of an input in a kernel, 1/2ℓ², of its length scale ℓ.
#[must_use]
pub fn relevance(length: f64) -> f64 {
    0.5 / (length * length)
}

/// Rows one after another, and the same rows in blocks, as a [`Correction`] needs them.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedRows<T, const D: usize> {
    rows: Vec<[T; D]>,
    blocks: Vec<RowBlock<T, D>>,
}

impl<T: Copy, const D: usize> OwnedRows<T, D> {
    /// Returns the rows in blocks.
    pub fn blocks(&self) -> &[RowBlock<T, D>] {
        &self.blocks
    }

    fn as_rows(&self) -> InputRows<'_, T, D> {
        InputRows::new(&self.blocks, self.rows.len())
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

/// Derefs to the rows one after another.
impl<T, const D: usize> Deref for OwnedRows<T, D> {
    type Target = [[T; D]];

    fn deref(&self) -> &[[T; D]] {
        &self.rows
    }
}

/// A [`Correction`] that owns its data.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedCorrection<T: 'static, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first of them are the inducing rows.
    pub rows: OwnedRows<T, D>,
    /// Scales of the inputs.
    pub scales: [InputScale<T>; D],
    /// Strain from the features.
    pub direct: OwnedProcess<T, D>,
    /// Strain from the features of one side of time.
    pub one_sided: [OwnedOneSided<T, D>; S],
    /// Residual process: the error of the filter's strain, from all inputs.
    pub residual: OwnedProcess<T, D>,
    /// Strain from the features, trained on rows of simulated motions.
    pub simulated: Option<OwnedSimulated<T, D>>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance.
    pub variance_factor: T,
}

/// A [`Simulated`] that owns its data.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedSimulated<T: 'static, const D: usize> {
    /// Standardised inputs.
    pub rows: OwnedRows<T, D>,
    /// Scales of the inputs.
    pub scales: [InputScale<T>; D],
    /// Process of the rows.
    pub process: OwnedProcess<T, D>,
}

/// A [`Triangle`] with its columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedTriangle<T> {
    columns: Vec<[T; BLOCK]>,
    side: usize,
}

impl<T: Real> OwnedTriangle<T> {
    /// Builds it from the entries on and above the diagonal.
    pub fn new(side: usize, entry: impl Fn(usize, usize) -> T) -> Self {
        Self { columns: stripes(side, entry).collect(), side }
    }

    /// Builds it from the rows of an upper triangle, one after the other.
    pub fn of_rows(entries: &[T]) -> Self {
        let side = side_of(entries.len());
        // Row i is preceded by i rows of side, side - 1, … entries.
        Self::new(side, |i, j| entries.get(i * side - i * (i + 1) / 2 + j).copied().unwrap_or(T::zero()))
    }

    /// Returns the columns, stripe by stripe.
    pub fn columns(&self) -> &[[T; BLOCK]] {
        &self.columns
    }

    /// Returns the number of rows.
    pub const fn side(&self) -> usize {
        self.side
    }

    /// Returns the full matrix, row by row.
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

/// A [`OneSided`] that owns its data.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedOneSided<T: 'static, const D: usize> {
    /// The process.
    pub process: OwnedProcess<T, D>,
    /// The input that the linear part of its kernel takes.
    pub first: usize,
}

impl<const D: usize> OwnedOneSided<f64, D> {
    fn new(params: &ProcessParams) -> Self {
        Self { process: OwnedProcess::new(params), first: params.inputs.first().copied().unwrap_or(OUTPUTS) }
    }
}

impl<T: Real + 'static, const D: usize> OwnedOneSided<T, D> {
    fn one_sided(&self) -> OneSided<'_, T, D> {
        OneSided { process: self.process.process(), first: self.first }
    }
}

/// Returns the number n of rows of a triangle with `entries` = n (n + 1)/2.
pub(crate) fn side_of(entries: usize) -> usize {
    (0..).take_while(|side| side * (side + 1) / 2 <= entries).last().unwrap_or(0)
}

/// A [`Process`] that owns its data.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedProcess<T: 'static, const D: usize> {
    /// Weight of each training row.
    pub weights: Vec<T>,
    /// Part of the variance that the inducing rows explain.
    pub explained: OwnedTriangle<T>,
    /// Its other numbers.
    pub numbers: Process<'static, T, D>,
}

impl<T: Real + 'static, const D: usize, const S: usize> OwnedCorrection<T, D, S> {
    /// Borrows the correction in running form.
    pub fn correction(&self) -> Correction<'_, T, D, S> {
        Correction {
            rows: self.rows.as_rows(),
            scales: &self.scales,
            direct: self.direct.process(),
            one_sided: self.one_sided.each_ref().map(OwnedOneSided::one_sided),
            residual: self.residual.process(),
            simulated: self.simulated.as_ref().map(OwnedSimulated::simulated),
            limits: self.limits,
            strain_variance: self.strain_variance,
            variance_factor: self.variance_factor,
        }
    }

    /// Converts the correction to another precision.
    pub fn map<U: Real + 'static>(&self, number: impl Fn(T) -> U + Copy) -> OwnedCorrection<U, D, S> {
        OwnedCorrection {
            rows: self.rows.map(number),
            scales: in_precision(&self.scales, number),
            direct: self.direct.map(number),
            one_sided: self
                .one_sided
                .each_ref()
                .map(|side| OwnedOneSided { process: side.process.map(number), first: side.first }),
            residual: self.residual.map(number),
            simulated: self.simulated.as_ref().map(|simulated| simulated.map(number)),
            limits: StrainRange { lower: number(self.limits.lower), upper: number(self.limits.upper) },
            strain_variance: number(self.strain_variance),
            variance_factor: number(self.variance_factor),
        }
    }
}

impl InputScales {
    /// Scales of D inputs.
    #[must_use]
    pub fn to_core<const D: usize>(&self) -> [InputScale<f64>; D] {
        let number = |of: &[f64], i: usize| of.get(i).copied().unwrap_or(0.0);
        std::array::from_fn(|i| {
            let sd = number(&self.sd, i);
            let sd = if sd > 0.0 { sd } else { f64::INFINITY };
            InputScale { mean: number(&self.mean, i), sd, lower: number(&self.lower, i), upper: number(&self.upper, i) }
        })
    }
}

/// Returns the inputs as deviations from their means, in standard deviations.
#[must_use]
pub fn standardised<const D: usize>(scales: &[InputScale<f64>; D], row: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|i| (row[i] - scales[i].mean) / scales[i].sd)
}

impl<const D: usize, const S: usize> OwnedCorrection<f64, D, S> {
    /// Builds the correction from checked parameters; `inputs` are those of all rows, in order of time.
    #[must_use]
    pub fn new(params: &CorrectorParams, inputs: &[[f64; D]], limits: StrainRange<f64>) -> Self {
        let scales = params.inputs.to_core();
        let one_sided = |side: usize| params.one_sided.get(side).unwrap_or(&params.direct);
        let rows = params.order.iter().filter_map(|row| inputs.get(*row));
        Self {
            rows: rows.map(|row| standardised(&scales, row)).collect(),
            scales,
            direct: OwnedProcess::new(&params.direct),
            one_sided: std::array::from_fn(|side| OwnedOneSided::new(one_sided(side))),
            residual: OwnedProcess::new(&params.residual),
            simulated: None,
            limits,
            strain_variance: params.strain_sd.powi(2),
            variance_factor: params.sd_scale.powi(2),
        }
    }
}

impl<const D: usize> OwnedProcess<f64, D> {
    fn new(params: &ProcessParams) -> Self {
        let mut by_input = [0.0; D];
        for (place, length) in params.inputs.iter().zip(&params.lengths) {
            if let Some(of_input) = by_input.get_mut(*place) {
                *of_input = relevance(*length);
            }
        }
        Self {
            weights: params.weights.clone(),
            explained: OwnedTriangle::of_rows(&params.explained),
            numbers: Process {
                relevance: by_input,
                mean: params.mean,
                weights: &[],
                explained: Triangle::NONE,
                variance: params.sd.powi(2),
                noise: params.noise_sd.powi(2),
                widening: params.sd_scale.powi(2),
                least_variance: params.least_sd.powi(2),
            },
        }
    }
}

impl OwnedSimulated<f64, FILTER_INPUTS> {
    /// Builds it from checked parameters; `scales` are those of the correction, whose ranges are extended to the
    /// simulated rows.
    pub(crate) fn new(params: &SimulatedParams, scales: &[InputScale<f64>; FILTER_INPUTS]) -> Self {
        let inputs: Vec<_> = params.rows.iter().map(|past| filter_inputs(&[0.0; OUTPUTS], past)).collect();
        let mut wider = *scales;
        for (i, scale) in wider.iter_mut().enumerate().skip(OUTPUTS) {
            for row in &inputs {
                (scale.lower, scale.upper) = (scale.lower.min(row[i]), scale.upper.max(row[i]));
            }
        }
        let numbers = Process {
            relevance: std::array::from_fn(|i| if i < OUTPUTS { 0.0 } else { relevance(params.length) }),
            mean: params.mean,
            weights: &[],
            explained: Triangle::NONE,
            variance: 0.0,
            noise: params.sd.powi(2),
            widening: 1.0,
            least_variance: 0.0,
        };
        let process = OwnedProcess { weights: params.weights.clone(), explained: OwnedTriangle::default(), numbers };
        Self { rows: inputs.iter().map(|row| standardised(scales, row)).collect(), scales: wider, process }
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
