//! Many sensors of one kind, filtered at once: [`SparseEkf`] with a sensor in every lane of a vector register.
//!
//! # Policy
//! - Each sensor's belief is what [`SparseEkf`] with [`Compact`] makes of its readings: the same operations in the same order,
//!   no lane added to another. Where the processor can, products are fused with sums, so that results agree to rounding; with
//!   128-bit vectors on x86 nothing is fused, and they agree to the last bit.
//! - A reading that is NaN is missing. A sensor whose step is refused keeps its belief, as if it had not been stepped; its
//!   neighbours do not notice.
//! - Memory is allocated when a bank is made, and not by a step.

mod lane;
mod step;

use core::fmt;
use std::vec::Vec;

use fearless_simd::{Level, Simd, dispatch};
use ohmstrain_model::{SwitchedModel, Symmetric};

use self::lane::{Block, Row};
use self::step::step_blocks;
use crate::{Belief, Compact, Gaussian, Residual, SparseEkf, StepError};

pub use self::lane::Lane;

/// The sparse EKF of many sensors that share a model and a rate; R₀ is each sensor's own, so readings are ρ = R/R₀ - 1.
///
/// `B`, `N`, `L` as in [`SparseEkf`] and [`Belief`]. A polynomial gauge is computed in vectors, the exponential of the other
/// two sensor by sensor.
///
/// ```
/// use ohmstrain_ekf::Bank;
/// use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
/// #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01,
/// #     branches: [Branch {
/// #         tau_s: 20.0, extend_gain: 0.6, retract_gain: -0.4, extend_gain_slope: 0.0, retract_gain_slope: 0.0,
/// #     }],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
/// let model = SwitchedModel::<f64, 1, 4>::new(law, motion, noise)?;
/// let mut hand = Bank::<f64, 1, 4, 10>::new(model, 0.01, 3)?;
/// // At the mean strain before any reading, 0.15, the curve is at 0.222.
/// let refused = hand.step(&[0.05, f64::NAN, 0.25])?;
/// assert_eq!(refused, 0);
/// let strains: Vec<f64> = hand.strains().map(|strain| strain.mean).collect();
/// assert!(strains[0] < strains[1] && strains[1] < strains[2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Bank<T: Lane, const B: usize, const N: usize, const L: usize> {
    ekf: SparseEkf<T, Compact, B, N>,
    level: Level,
    sensors: usize,
    blocks: Vec<Block<T, N, L>>,
}

/// A slice that does not have one number for each sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrongLength {
    /// Sensors in the bank.
    pub sensors: usize,
    /// Numbers in the slice.
    pub found: usize,
}

impl fmt::Display for WrongLength {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} numbers for {} sensors", self.found, self.sensors)
    }
}

impl core::error::Error for WrongLength {}

impl<T: Lane, const B: usize, const N: usize, const L: usize> Bank<T, B, N, L> {
    /// Sensors in a block.
    const LANES: usize = 64 / size_of::<T>();

    /// A bank of `sensors` in the model's long-run distribution, for steps of `dt_s` seconds, with the widest vectors that
    /// the processor has.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number.
    pub fn new(model: SwitchedModel<T, B, N>, dt_s: T, sensors: usize) -> Result<Self, StepError> {
        let ekf = SparseEkf::new(model, dt_s)?;
        let start = Belief::<T, N, L>::initial(ekf.model());
        let zero = T::row(T::zero());
        let block = Block {
            mean: core::array::from_fn(|i| T::row(start.mean[i])),
            covariance: start.covariance.packed().map(T::row),
            innovation: zero,
            innovation_variance: zero,
            taken: 0,
            refused: 0,
            errors: [StepError::NonFiniteState; 16],
        };
        let blocks = std::vec![block; sensors.div_ceil(Self::LANES)];
        Ok(Self { ekf, level: Level::new(), sensors, blocks })
    }

    /// The same bank with vectors of no more than that many bits, as far as the processor has such; 512 is no restriction.
    #[must_use]
    pub fn with_vectors_up_to(mut self, bits: usize) -> Self {
        self.level = narrowed(Level::new(), bits);
        self
    }

    /// Number of sensors.
    #[must_use]
    pub const fn sensors(&self) -> usize {
        self.sensors
    }

    /// The model they share.
    pub const fn model(&self) -> &SwitchedModel<T, B, N> {
        self.ekf.model()
    }

    /// One step of every sensor; `readings` has ρ of each, NaN where there is none. Returns how many were refused, which
    /// [`Self::outcome`] tells of each.
    ///
    /// # Errors
    /// If there is not one reading for each sensor; then nothing is stepped.
    pub fn step(&mut self, readings: &[T]) -> Result<usize, WrongLength> {
        self.step_all(readings, None)
    }

    /// [`Self::step`] with a variance for each reading on top of the model's, relative to R₀, squared.
    ///
    /// # Errors
    /// If there is not one reading and one variance for each sensor; then nothing is stepped.
    pub fn step_with_variances(&mut self, readings: &[T], extra_variances: &[T]) -> Result<usize, WrongLength> {
        self.step_all(readings, Some(extra_variances))
    }

    fn step_all(&mut self, readings: &[T], extra: Option<&[T]>) -> Result<usize, WrongLength> {
        for slice in [Some(readings), extra].into_iter().flatten() {
            if slice.len() != self.sensors {
                return Err(WrongLength { sensors: self.sensors, found: slice.len() });
            }
        }
        Ok(dispatch!(self.level, simd => step_blocks(simd, &self.ekf, &mut self.blocks, readings, extra)))
    }

    /// What the last step did to a sensor, as [`SparseEkf::step`] returns it: `None` in it for a missing reading, and before
    /// the first step. `None` if there is no such sensor.
    #[must_use]
    pub fn outcome(&self, sensor: usize) -> Option<Result<Option<Residual<T>>, StepError>> {
        let (block, lane) = self.at(sensor)?;
        if block.refused >> lane & 1 == 1 {
            return Some(Err(block.errors[lane]));
        }
        let residual = || {
            let (innovation, variance) = (number(&block.innovation, lane), number(&block.innovation_variance, lane));
            Residual { innovation, variance, nis: innovation * (innovation * (T::one() / variance)) }
        };
        Some(Ok((block.taken >> lane & 1 == 1).then(residual)))
    }

    /// Strain of a sensor; `None` if there is no such sensor.
    #[must_use]
    pub fn strain(&self, sensor: usize) -> Option<Gaussian<T>> {
        self.at(sensor).map(|(block, lane)| block.strain(lane))
    }

    /// Strains of all sensors in their order.
    pub fn strains(&self) -> impl Iterator<Item = Gaussian<T>> + '_ {
        let lanes = |block| (0..Self::LANES).map(move |lane| Block::strain(block, lane));
        self.blocks.iter().flat_map(lanes).take(self.sensors)
    }

    /// All that is known of a sensor; `None` if there is no such sensor.
    #[must_use]
    pub fn belief(&self, sensor: usize) -> Option<Belief<T, N, L>> {
        self.at(sensor).map(|(block, lane)| block.belief(lane))
    }

    /// Gives a sensor another belief, for example [`Belief::initial`] after it was replaced. Returns whether there is such a
    /// sensor.
    pub fn set_belief(&mut self, sensor: usize, belief: &Belief<T, N, L>) -> bool {
        let (lane, found) = (sensor % Self::LANES, sensor < self.sensors);
        let block = self.blocks.get_mut(sensor / Self::LANES).filter(|_| found);
        if let Some(block) = block {
            block.set_belief(lane, belief);
        }
        found
    }

    fn at(&self, sensor: usize) -> Option<(&Block<T, N, L>, usize)> {
        let block = self.blocks.get(sensor / Self::LANES).filter(|_| sensor < self.sensors)?;
        Some((block, sensor % Self::LANES))
    }
}

impl<T: Lane, const N: usize, const L: usize> Block<T, N, L> {
    fn belief(&self, lane: usize) -> Belief<T, N, L> {
        let covariance = core::array::from_fn(|i| number(&self.covariance[i], lane));
        let mean: [T; N] = core::array::from_fn(|i| number(&self.mean[i], lane));
        Belief { mean: mean.into(), covariance: Symmetric::from_packed(covariance) }
    }

    fn set_belief(&mut self, lane: usize, belief: &Belief<T, N, L>) {
        let rows = self.mean.iter_mut().chain(&mut self.covariance);
        for (row, number) in rows.zip(belief.mean.iter().chain(belief.covariance.packed())) {
            row.0.as_mut()[lane] = *number;
        }
    }

    fn strain(&self, lane: usize) -> Gaussian<T> {
        Gaussian { mean: number(&self.mean[0], lane), variance: number(&self.covariance[0], lane) }
    }
}

fn number<T: Copy, A: AsRef<[T]>>(row: &Row<A>, lane: usize) -> T {
    row.0.as_ref()[lane]
}

fn narrowed(level: Level, bits: usize) -> Level {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        let narrower = match bits {
            512.. => None,
            256..512 => level.as_avx2().map(Simd::level),
            _ => level.as_sse4_2().map(Simd::level).or_else(|| level.as_sse2().map(Simd::level)),
        };
        narrower.unwrap_or(level)
    }
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    {
        let _ = bits;
        level
    }
}
