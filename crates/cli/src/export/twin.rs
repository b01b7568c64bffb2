//! The exported program in Rust, in any precision: the filter, what a reading must be for it, and the correction.

use ohmstrain_calib::{EstimatorKind, PortableCorrection, PortableSieve};
use ohmstrain_ekf::Belief;
use ohmstrain_ekf::correction::{FEATURES, FeatureScale, ReadingFeatures};
use ohmstrain_ekf::{
    Dwell, Evidence, Gaussian, Reading, Real, SparseEkf, SparseHypotheses, SparseMixture, SparseSignSplit, StepError,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};

use super::doubt::{Doubt, DoubtParts};
use super::learned::{INPUTS, Table};
use super::moving::Moving;
use super::quadratic::Quadratic;

/// The most tries with more noise after a reading was refused, and the growth of its noise; as `SparseEkf`.
const MOST_TRIES: u32 = 12;
const COARSER: f64 = 16.0;
/// Into how many steps an interval is divided at most.
const MOST_STEPS: u32 = 128;

/// What became of a reading, as `ohmstrain_flag` in C has it.
pub mod flag {
    pub const MISSING: u32 = 1;
    pub const IMPLAUSIBLE: u32 = 2;
    pub const STUCK: u32 = 4;
    pub const REJECTED: u32 = 8;
    pub const DOWNWEIGHTED: u32 = 16;
    pub const START_UP: u32 = 32;
    pub const RECOVERING: u32 = 64;
    pub const EXTRAPOLATED: u32 = 128;
    pub const LONG_RUN: u32 = 256;

    /// The reading was not used.
    pub const NO_READING: u32 = MISSING | IMPLAUSIBLE | STUCK | REJECTED;
}

/// What a twin is made of, whatever its precision.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub kind: EstimatorKind,
    /// Usual time between readings, s, and the longest step: longer times are divided.
    pub dt_s: f32,
    pub longest_step_s: f32,
    /// How long phases last, and whether the body rests; `None` for a filter without phases.
    pub phases: Option<PhaseParts>,
    pub limits: StrainRange<f32>,
    pub strain_sd_scale: f32,
    pub sieve: PortableSieve,
    pub correction: Option<&'a PortableCorrection>,
    /// What stands for rows of the correction that were left out.
    pub quadratics: Option<&'a [Quadratic; 2]>,
    pub doubt: DoubtParts,
}

/// Phases, as a file has them.
#[derive(Clone, Copy)]
pub struct PhaseParts {
    pub hold_time_s: f64,
    pub move_time_s: f64,
    pub reversal: f64,
    pub tempering: f64,
    pub rests: bool,
}

/// What depends on the length of a step: the kernel's numbers, then nine probabilities of the chain.
pub type Numbers<'a, T> = Box<dyn Fn(T) -> Vec<T> + 'a>;

/// The exported program.
pub struct Twin<'a, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> {
    moving: Moving<T, B, N, L, K>,
    dt_s: T,
    longest_step_s: T,
    /// Length of the steps that the filter is prepared for, and what depends on it for another one.
    step_s: T,
    numbers: Numbers<'a, T>,
    sieve: PortableSieve,
    seen: Seen<T>,
    reading_variance: T,
    limits: StrainRange<T>,
    strain_sd_scale: T,
    correction: Option<(Table<T>, ReadingFeatures<T>)>,
    /// Features at the last reading, the filter's variance then, and whether the row had none.
    features: Option<[T; FEATURES]>,
    known_variance: T,
    missing: bool,
    doubt: Doubt<T>,
    /// As it is reported.
    strain: Gaussian<T>,
    /// How many hypotheses have been moved on: with a reading, and without.
    work: [usize; 2],
}

/// What was seen of the readings.
struct Seen<T> {
    last: Option<T>,
    since_s: T,
    repeated_s: T,
    count: u32,
}

/// A number of a file, as exactly as the precision can have it.
pub fn number<T: Real>(value: f64) -> T {
    T::of(value)
}

impl<'a, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Twin<'a, T, B, N, L, K> {
    /// Before any reading.
    ///
    /// # Errors
    /// If the filter cannot work with its numbers.
    pub fn new(model: SwitchedModel<T, B, N>, parts: &Parts<'_>, numbers: Numbers<'a, T>) -> Result<Self, StepError> {
        let dt_s: T = number(parts.dt_s.into());
        let limits = StrainRange { lower: number(parts.limits.lower.into()), upper: number(parts.limits.upper.into()) };
        let belief = Belief::initial(&model);
        let kernel = SparseEkf::new(model, dt_s)?;
        let moving = match (parts.kind, parts.phases) {
            (EstimatorKind::SignSplit, Some(phases)) => {
                let (dwell, evidence) = phases.filter_parts(limits)?;
                let filter = SparseSignSplit::around(kernel, phases.rests.then_some(dwell), evidence);
                Moving::SignSplit(filter, SparseMixture::single(belief, Phase::Extend))
            }
            (EstimatorKind::Hypotheses, Some(phases)) => {
                let (dwell, evidence) = phases.filter_parts(limits)?;
                let filter = SparseHypotheses::around(kernel, dwell, evidence);
                Moving::Histories(filter, SparseMixture::single(belief, Phase::Hold))
            }
            _ => Moving::Ekf(kernel, belief),
        };
        let sd = model.noise().reading_sd;
        let correction = parts.correction.map(|correction| {
            let FeatureScale { centre, half_range, rates } = correction.features;
            let scale =
                FeatureScale { centre: number(centre), half_range: number(half_range), rates: rates.map(number) };
            (Table::new(correction, parts.quadratics), ReadingFeatures::new(scale))
        });
        Ok(Self {
            moving,
            dt_s,
            longest_step_s: number(parts.longest_step_s.into()),
            step_s: T::zero(),
            numbers,
            sieve: parts.sieve,
            seen: Seen { last: None, since_s: T::zero(), repeated_s: T::zero(), count: 0 },
            reading_variance: sd * sd,
            limits,
            strain_sd_scale: number(parts.strain_sd_scale.into()),
            correction,
            features: None,
            known_variance: T::zero(),
            missing: true,
            doubt: Doubt::new(parts.doubt),
            strain: Gaussian { mean: T::zero(), variance: T::zero() },
            work: [0; 2],
        })
    }

    /// The usual time on, with a reading or without; flags.
    ///
    /// # Errors
    /// If even a prediction is refused.
    pub fn step(&mut self, reading: Option<Reading<T>>) -> Result<u32, StepError> {
        self.step_after(self.dt_s, reading)
    }

    /// The same, `dt_s` seconds on.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_after(&mut self, dt_s: T, reading: Option<Reading<T>>) -> Result<u32, StepError> {
        self.seen.since_s += dt_s;
        self.seen.repeated_s += dt_s;
        let (mut flags, mut used) = (flag::MISSING, None);
        if let Some(reading) = reading {
            (flags, used) = match self.sieved(reading) {
                Ok(reading) => (0, Some(reading)),
                Err(flag) => (flag, None),
            };
        }
        for _ in 1..self.prepare(dt_s) {
            self.work[1] += self.moving.count();
            self.moving.step(None)?;
        }
        let (taken, nis) = self.taken(used)?;
        flags |= taken;
        let is_seen = flags == 0;
        let filtered = self.filtered();
        if let Some((_, features)) = &mut self.correction {
            self.features = features.step(dt_s, reading.filter(|_| is_seen).map(|reading| reading.value));
            self.missing = !is_seen;
            self.known_variance = if is_seen { filtered.variance } else { self.known_variance };
        }
        let Gaussian { mean, variance } = self.corrected();
        let used = reading.filter(|_| flags & flag::NO_READING == 0).map(|reading| (reading.value, nis));
        self.doubt.see(dt_s, used, variance);
        let (variance, doubts) = self.doubt.widened(self.moving.moments().mean[1], variance);
        self.strain = Gaussian { mean, variance };
        Ok(flags | doubts)
    }

    /// Prepares the steps that `dt_s` seconds are divided into; how many they are.
    fn prepare(&mut self, dt_s: T) -> u32 {
        let (mut count, mut covered) = (1, self.longest_step_s);
        while covered < dt_s && count < MOST_STEPS {
            covered += self.longest_step_s;
            count += 1;
        }
        let step_s = dt_s / T::of(f64::from(count));
        if step_s != self.step_s {
            self.moving.set_step(step_s, &(self.numbers)(step_s));
            self.step_s = step_s;
        }
        count
    }

    /// Takes a reading, with more and more noise where it is refused; flags, and its normalised
    /// innovation squared as it came.
    fn taken(&mut self, reading: Option<Reading<T>>) -> Result<(u32, T), StepError> {
        self.work[usize::from(reading.is_none())] += self.moving.count();
        let Some(mut reading) = reading else {
            self.moving.step(None)?;
            return Ok((0, T::zero()));
        };
        for _ in 0..=MOST_TRIES {
            let count = self.moving.count();
            if let Ok(taken) = self.moving.take(reading) {
                // What surprises is taken twice.
                self.work[0] += if taken.0 == 0 { 0 } else { count };
                return Ok(taken);
            }
            let rounding = T::default_epsilon() * T::default_epsilon();
            let noise = reading.extra_variance + self.reading_variance + rounding;
            if !(reading.value * reading.value / noise).is_finite() {
                break;
            }
            reading.extra_variance = T::of(COARSER) * noise;
            self.work[0] += count;
        }
        self.moving.step(None)?;
        Ok((flag::REJECTED, T::zero()))
    }

    fn sieved(&mut self, reading: Reading<T>) -> Result<Reading<T>, u32> {
        let (sieve, seen) = (&self.sieve, &mut self.seen);
        let (lower, upper): (T, T) = (number(sieve.plausible.0), number(sieve.plausible.1));
        if !(lower <= reading.value && reading.value <= upper) {
            return Err(flag::IMPLAUSIBLE);
        }
        let (is_first, since_s) = (seen.last.is_none(), seen.since_s);
        if seen.last == Some(reading.value) {
            seen.count += 1;
        } else {
            (seen.count, seen.repeated_s) = (0, T::zero());
        }
        (seen.last, seen.since_s) = (Some(reading.value), T::zero());
        let longest_s = sieve.longest_repeat_s;
        if longest_s.is_finite() && seen.count >= sieve.most_repeats && seen.repeated_s > number(longest_s) {
            return Err(flag::STUCK);
        }
        let variance = self.reading_variance + reading.extra_variance;
        let mut extra_variance = reading.extra_variance + T::of(f64::from(seen.count)) * variance;
        if sieve.error_time_s > 0.0 && !is_first {
            let news = -(-since_s / number(sieve.error_time_s)).exp_m1();
            let least = T::of(f64::from(f32::EPSILON));
            let news = if news > least { news } else { least };
            extra_variance += (T::one() / news - T::one()) * self.reading_variance;
        }
        Ok(Reading { extra_variance, ..reading })
    }

    /// The filter's strain, moved into the limits.
    fn filtered(&self) -> Gaussian<T> {
        let belief = self.moving.moments();
        let variance = belief.covariance[(0, 0)].max(T::zero()) * self.strain_sd_scale * self.strain_sd_scale;
        Gaussian { mean: belief.mean[0], variance }.clamped(&self.limits)
    }

    /// How many hypotheses have been moved on, with a reading and without: what a filter's instructions are due to.
    pub const fn work(&self) -> [usize; 2] {
        self.work
    }

    /// The strain as it is reported.
    pub const fn strain(&self) -> Gaussian<T>
    where
        T: Copy,
    {
        self.strain
    }

    /// The filter's strain, corrected.
    fn corrected(&self) -> Gaussian<T> {
        let filtered = self.filtered();
        let (Some((table, _)), Some(features)) = (&self.correction, self.features) else { return filtered };
        let belief = self.moving.moments();
        let relaxation = (2..2 + B).fold(T::zero(), |sum, i| sum + belief.mean[i]);
        let baseline = if N == B + 3 { belief.mean[N - 1] } else { T::zero() };
        let [extend, _, retract] = self.moving.phases();
        let outputs = [filtered.mean, belief.mean[1], relaxation, baseline, extend, retract];
        let mut inputs = [T::zero(); INPUTS];
        inputs.iter_mut().zip(outputs.iter().chain(&features)).for_each(|(place, input)| *place = *input);
        let strain = table.correct(&inputs, filtered, self.limits);
        let grown = (filtered.variance - self.known_variance).max(T::zero());
        if self.missing { Gaussian { variance: strain.variance + grown, ..strain } } else { strain }
    }
}

impl PhaseParts {
    /// Dwell times, and what weighs hypotheses.
    ///
    /// # Errors
    /// If single precision has no such numbers.
    pub fn filter_parts<T: Real>(&self, limits: StrainRange<T>) -> Result<(Dwell<T>, Evidence<T>), StepError> {
        let dwell = Dwell::new(number(self.hold_time_s), number(self.move_time_s), number(self.reversal));
        let evidence = Evidence::new(limits, number(self.tempering));
        // Checked when the file was read; single precision may still turn a number into zero.
        dwell.and_then(|dwell| Ok((dwell, evidence?))).map_err(|_| StepError::NonFiniteState)
    }
}
