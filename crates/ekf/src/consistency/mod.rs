//! Is a running filter's own uncertainty right? Judged by its innovations, without the truth.
//!
//! A [`ConsistencyRecord`] accumulates in fixed memory, one call per step; a [`ConsistencyTest`] is what to hold it
//! against. Counting is over accepted readings only: a missing or gated one has no normalised innovation, and no product
//! of innovations reaches across it with a wrong distance, because lags count steps. What is not finite counts as missing.
//!
//! Sources: Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), 5.4; Ljung &
//! Box, *Biometrika* 65 (1978) 297.

mod chi_square;
mod lags;

pub use chi_square::ChiSquare;

use core::fmt;

use nalgebra::SVector;
use ohmstrain_model::{ParameterError, Problem, Symmetric};

use crate::belief::psd::SemiDefinite;
use crate::consistency::chi_square::gated_moments;
use crate::consistency::lags::{Lags, Sum};
use crate::{Real, Step, Update};

/// What a filter's normalised errors say of its variances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// No contradiction.
    Consistent,
    /// Errors are larger than the filter believes.
    Overconfident,
    /// Errors are smaller than the filter believes.
    Underconfident,
    /// Not enough readings to tell.
    TooFew,
}

impl fmt::Display for Verdict {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Consistent => "consistent",
            Self::Overconfident => "overconfident",
            Self::Underconfident => "underconfident",
            Self::TooFew => "too few",
        })
    }
}

/// Running sums over the steps of one filter; `H` is the largest lag at which innovations are compared.
///
/// ```
/// use ohmstrain_ekf::{ConsistencyRecord, ConsistencyTest, Verdict};
/// let mut record = ConsistencyRecord::<f64, 10>::new();
/// record.miss();
/// record.accept_standardised(0.3);
/// let report = ConsistencyTest::new(0.01)?.report(&record);
/// assert_eq!((report.accepted, report.missing, report.verdict), (1, 1, Verdict::TooFew));
/// # Ok::<(), ohmstrain_model::ParameterError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsistencyRecord<T, const H: usize> {
    nis: Sum<T>,
    accepted: usize,
    gated: usize,
    missing: usize,
    lags: Lags<T, H>,
    nees: Sum<T>,
    nees_dof: usize,
}

impl<T: Real, const H: usize> ConsistencyRecord<T, H> {
    /// Nothing seen yet.
    #[must_use]
    pub fn new() -> Self {
        Self { nis: Sum::zero(), accepted: 0, gated: 0, missing: 0, lags: Lags::new(), nees: Sum::zero(), nees_dof: 0 }
    }

    /// A step as the filter returned it: its reading accepted, or missing.
    pub fn step<const N: usize, const L: usize>(&mut self, step: &Step<T, N, L>) {
        match &step.update {
            Some(update) => self.accept(update),
            None => self.miss(),
        }
    }

    /// A reading that the filter took.
    pub fn accept<const N: usize>(&mut self, update: &Update<T, N>) {
        self.accept_standardised(update.innovation / update.innovation_variance.sqrt());
    }

    /// The same from ν/√S: innovation over its own standard deviation.
    pub fn accept_standardised(&mut self, innovation: T) {
        if !(innovation * innovation).is_finite() {
            return self.miss();
        }
        self.nis.add(innovation * innovation);
        self.accepted += 1;
        self.lags.push(Some(innovation));
    }

    /// A reading that was refused as an outlier.
    pub fn gate(&mut self) {
        self.gated += 1;
        self.lags.push(None);
    }

    /// A step without a reading.
    pub fn miss(&mut self) {
        self.missing += 1;
        self.lags.push(None);
    }

    /// The normalised error squared `eᵀ P⁻¹ e` of a state whose truth is known, returned and added up: χ² with as many
    /// degrees of freedom as P has uncertain directions.
    ///
    /// The errors of successive steps are correlated. For the verdict to keep its level, add errors of different runs,
    /// or of steps many correlation times apart.
    pub fn add_error<const N: usize, const L: usize>(
        &mut self,
        error: &SVector<T, N>,
        covariance: &Symmetric<T, N, L>,
    ) -> T {
        let factor = SemiDefinite::factor(covariance);
        let nees = error.dot(&factor.solve(error));
        if nees.is_finite() {
            self.nees.add(nees);
            self.nees_dof += (0..N).filter(|i| factor.pivot(*i) > T::zero()).count();
        }
        nees
    }
}

impl<T: Real, const H: usize> Default for ConsistencyRecord<T, H> {
    fn default() -> Self {
        Self::new()
    }
}

/// What to hold a [`ConsistencyRecord`] against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsistencyTest<T> {
    false_alarm: T,
    minimum: usize,
    gate: Option<T>,
}

/// A mean of normalised errors squared and where it should lie.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MeanTest<T> {
    /// Mean per degree of freedom.
    pub mean: T,
    /// What it is in a consistent filter: 1, or less if larger ones were gated.
    pub expected: T,
    /// Below, the filter is underconfident.
    pub lower: T,
    /// Above, it is overconfident.
    pub upper: T,
}

impl<T: Real> MeanTest<T> {
    /// On which side of its bounds the mean lies.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.mean > self.upper {
            Verdict::Overconfident
        } else if self.mean < self.lower {
            Verdict::Underconfident
        } else {
            Verdict::Consistent
        }
    }
}

/// Do innovations know of each other? Ljung and Box's test.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Whiteness<T> {
    /// Their statistic, χ² if innovations are white.
    pub statistic: T,
    /// Lags at which there were pairs of innovations.
    pub lags: usize,
    /// Probability that white innovations give as large a statistic.
    pub p_value: T,
    /// Whether that is at least the test's false-alarm rate.
    pub white: bool,
}

/// All that a record says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConsistencyReport<T> {
    /// From NIS, and NEES where there is one. Coloured innovations do not enter: they mean a wrong model, but neither too
    /// much nor too little confidence.
    pub verdict: Verdict,
    /// Normalised innovations squared; `None` if too few.
    pub nis: Option<MeanTest<T>>,
    /// Normalised errors squared; `None` if too few or none were added.
    pub nees: Option<MeanTest<T>>,
    /// Whiteness of the innovations; `None` if too few, or no two of them at any of the lags.
    pub whiteness: Option<Whiteness<T>>,
    /// Readings taken.
    pub accepted: usize,
    /// Readings refused.
    pub gated: usize,
    /// Steps without a reading.
    pub missing: usize,
}

/// Fewer accepted readings are too few, unless [`ConsistencyTest::with_minimum`] says otherwise.
const MINIMUM: usize = 30;

impl<T: Real> ConsistencyTest<T> {
    /// `false_alarm`: how often a consistent filter may be called inconsistent, and white innovations coloured; between
    /// 0 and 1, usually 0.01 to 0.05.
    ///
    /// # Errors
    /// Names a rate that is out of range.
    pub fn new(false_alarm: T) -> Result<Self, ParameterError> {
        if !(false_alarm > T::zero() && false_alarm < T::one()) {
            return Err(ParameterError::new("false_alarm", Problem::OutOfRange));
        }
        Ok(Self { false_alarm, minimum: MINIMUM, gate: None })
    }

    /// How many readings (degrees of freedom of errors) a verdict takes, 30 unless set.
    #[must_use]
    pub fn with_minimum(self, minimum: usize) -> Self {
        Self { minimum: minimum.max(1), ..self }
    }

    /// The filter refuses readings with a NIS above `gate ≥ 1`.
    ///
    /// Those accepted then have a smaller NIS than χ² (0.973 for a gate of 9), and an overconfident filter looks better
    /// the more it refuses. Mean and variance of NIS are corrected for the gate here. Look at the number of gated readings
    /// besides: of a consistent filter's, `ChiSquare::new(1.0).upper_tail(gate)` are.
    ///
    /// # Errors
    /// Names a gate that is less than one or not finite.
    pub fn with_gate(self, gate: T) -> Result<Self, ParameterError> {
        if !(gate >= T::one() && gate.is_finite()) {
            return Err(ParameterError::new("gate", Problem::OutOfRange));
        }
        Ok(Self { gate: Some(gate), ..self })
    }

    /// The verdict, and what it rests on. Where there is a NEES beside the NIS, each is tested at half the rate, so that
    /// both together keep it.
    #[must_use]
    pub fn report<const H: usize>(&self, record: &ConsistencyRecord<T, H>) -> ConsistencyReport<T> {
        let enough = |count: usize| count >= self.minimum;
        let has_nees = enough(record.nees_dof);
        let rate = if has_nees { self.false_alarm / T::of(2.0) } else { self.false_alarm };
        let moments = self.gate.map_or((T::one(), T::of(2.0)), gated_moments);
        let nis = enough(record.accepted).then(|| mean_test(record.nis.value(), record.accepted, moments, rate));
        let nees = has_nees.then(|| mean_test(record.nees.value(), record.nees_dof, (T::one(), T::of(2.0)), rate));
        let verdicts = [nis, nees].map(|test| test.map(|test| test.verdict()));
        let whiteness = if enough(record.accepted) { self.whiteness(record) } else { None };
        ConsistencyReport {
            verdict: worst(verdicts),
            nis,
            nees,
            whiteness,
            accepted: record.accepted,
            gated: record.gated,
            missing: record.missing,
        }
    }

    fn whiteness<const H: usize>(&self, record: &ConsistencyRecord<T, H>) -> Option<Whiteness<T>> {
        let (statistic, lags) = record.lags.ljung_box(record.nis.value(), record.accepted)?;
        let p_value = ChiSquare::new(T::of(lags as f64)).upper_tail(statistic);
        Some(Whiteness { statistic, lags, p_value, white: p_value >= self.false_alarm })
    }
}

/// Too much confidence is the worse fault; it is named first if NIS and NEES disagree.
fn worst(verdicts: [Option<Verdict>; 2]) -> Verdict {
    for fault in [Verdict::Overconfident, Verdict::Underconfident, Verdict::Consistent] {
        if verdicts.contains(&Some(fault)) {
            return fault;
        }
    }
    Verdict::TooFew
}

/// Bounds of the mean of `count` independent numbers with these moments, from the χ² distribution, stretched, that has the
/// mean and variance of their sum. For χ² itself it is the exact one.
fn mean_test<T: Real>(sum: T, count: usize, (mean, variance): (T, T), rate: T) -> MeanTest<T> {
    let count = T::of(count as f64);
    let dof = T::of(2.0) * mean * mean / variance * count;
    let sums = ChiSquare::new(dof);
    let half = rate / T::of(2.0);
    MeanTest {
        mean: sum / count,
        expected: mean,
        lower: sums.upper_quantile(T::one() - half) / dof * mean,
        upper: sums.upper_quantile(half) / dof * mean,
    }
}
