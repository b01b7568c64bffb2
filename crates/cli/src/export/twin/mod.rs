//! The exported program in Rust, in any precision: the filter, what a reading must be for it, and the correction.

mod parts;
mod seen;

use ohmstrain::{Doubts, RestFollower};
use ohmstrain_calib::{BESIDE_AFTER, EstimatorKind, STARTLING_NIS, SURPRISING_NIS};
use ohmstrain_ekf::correction::{FEATURES, FeatureScale, ReadingFeatures};
use ohmstrain_ekf::{Belief, Gaussian, Hypotheses, Mixture, Reading, Real, SignSplit, SparseEkf, StepError};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};

use super::learned::{INPUTS, Learned};
use super::moving::Moving;
pub use parts::{Numbers, Parts, PhaseParts, flag, number};
use seen::Seen;

/// Into how many steps an interval is divided at most.
const MOST_STEPS: u32 = 128;

/// The exported program.
pub struct Twin<'a, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> {
    model: SwitchedModel<T, B, N>,
    dt_s: T,
    longest_step_s: T,
    /// What depends on the length of a step.
    numbers: Numbers<'a, T>,
    limits: StrainRange<T>,
    strain_sd_scale: T,
    /// Variance of a strain that is known at a start.
    start_variance: T,
    /// A strain that is less is none.
    zero: T,
    correction: Option<Learned<T>>,
    /// As it is before any reading, and now.
    fresh: Memory<T, B, N, L, K>,
    now: Memory<T, B, N, L, K>,
    /// How many hypotheses have been moved on: with a reading, and without.
    work: [usize; 2],
}

/// What changes from step to step.
#[derive(Clone, Copy)]
struct Memory<T, const B: usize, const N: usize, const L: usize, const K: usize> {
    moving: Moving<T, B, N, L, K>,
    /// Length of the steps that the filter is prepared for.
    step_s: T,
    seen: Seen<T>,
    /// What the correction sees of readings, if there is one.
    watched: Option<ReadingFeatures<T>>,
    /// Features at the last reading, the filter's variance then, and whether the row had none.
    features: Option<[T; FEATURES]>,
    known_variance: T,
    missing: bool,
    /// Readings in a row that startled.
    startling: u32,
    /// The last one that did not surprise.
    calm: Option<T>,
    doubts: Doubts<T>,
    /// None where R₀ is told.
    follower: Option<RestFollower<T>>,
    /// As it is reported.
    strain: Gaussian<T>,
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
                let filter = SignSplit::around(kernel, phases.rests.then_some(dwell), evidence);
                Moving::SignSplit(filter, Mixture::single(belief, Phase::Extend))
            }
            (EstimatorKind::Hypotheses, Some(phases)) => {
                let (dwell, evidence) = phases.filter_parts(limits)?;
                let filter = Hypotheses::around(kernel, dwell, evidence);
                Moving::Histories(filter, Mixture::single(belief, Phase::Hold))
            }
            _ => Moving::Ekf(kernel, belief),
        };
        let sd = model.noise().reading_sd;
        let watched = parts.correction.map(|correction| {
            let FeatureScale { centre, half_range, rates, starts } = correction.features;
            let starts = starts.map(|start| start.map(number));
            let (centre, half_range) = (number(centre), number(half_range));
            ReadingFeatures::new(FeatureScale { centre, half_range, rates: rates.map(number), starts })
        });
        let doubts = Doubts::new(parts.doubt);
        let fresh = Memory {
            moving,
            // None yet.
            step_s: -T::one(),
            seen: Seen::new(parts.sieve, sd * sd),
            watched,
            features: None,
            known_variance: T::zero(),
            missing: true,
            startling: 0,
            calm: None,
            doubts: if parts.correction.is_some() { doubts.of_corrected() } else { doubts },
            follower: Some(RestFollower::new(parts.rest)),
            strain: Gaussian { mean: T::zero(), variance: T::zero() },
        };
        Ok(Self {
            model,
            dt_s,
            longest_step_s: number(parts.longest_step_s.into()),
            numbers,
            limits,
            strain_sd_scale: number(parts.strain_sd_scale.into()),
            start_variance: number(parts.start_variance.into()),
            zero: number(parts.zero.into()),
            correction: parts.correction.map(|correction| Learned::new(&correction.learned, parts.quadratics, limits)),
            fresh,
            now: fresh,
            work: [0; 2],
        })
    }

    /// Begins again with an R₀ that has been told, at a strain that is known if there is one.
    pub fn restart(&mut self, strain: Option<T>) {
        self.now = self.fresh;
        self.now.follower = None;
        let Some(strain) = strain else { return };
        let (mut mean, mut variance) = self.model.initial_distribution();
        (mean[0], variance[0]) = (strain, self.start_variance);
        self.now.moving.start_from(Belief::independent(mean, &variance));
        self.now.doubts = self.now.doubts.of_known_strain(strain.abs() <= self.zero);
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
        self.now.seen.pass(dt_s);
        let (mut flags, mut used) = (flag::MISSING, None);
        let relative = reading.map(|reading| self.now.follower.map_or(reading, |follower| follower.relative(reading)));
        if let Some(relative) = relative {
            (flags, used) = match self.now.seen.sieved(relative) {
                Ok(reading) => (0, Some(reading)),
                Err(flag) => (flag, None),
            };
        }
        for _ in 1..self.prepare(dt_s) {
            self.work[1] += self.now.moving.count();
            self.now.moving.step(None)?;
        }
        let (taken, nis) = self.taken(used)?;
        flags |= taken;
        let surprises = flags == flag::DOWNWEIGHTED;
        let seen = used.filter(|_| flags & flag::NO_READING == 0).map(|used| used.value);
        let startled = seen.and_then(|reading| self.startled(reading, nis));
        if startled.is_some() {
            self.now.moving.look_again(&self.fresh.moving);
        }
        let shown = relative.filter(|_| flags == 0 || surprises).map(|reading| reading.value);
        let filtered = self.filtered();
        if let Some(watched) = &mut self.now.watched {
            self.now.features = watched.step_unless(surprises, dt_s, shown);
            self.now.missing = watched.is_waiting();
            self.now.known_variance = if self.now.missing { self.now.known_variance } else { filtered.variance };
        }
        let Gaussian { mean, variance } = self.corrected();
        let used = reading.filter(|_| flags & flag::NO_READING == 0).map(|reading| (reading.value, nis));
        if let (Some(follower), Some((reading, _))) = (&mut self.now.follower, used) {
            startled.into_iter().for_each(|jump| follower.jumped(jump));
            follower.see(dt_s, reading);
        }
        let variance = self.now.doubts.see(dt_s, used, Gaussian { mean, variance });
        let (variance, doubts) = self.now.doubts.widened(self.now.moving.moments().mean[1], variance);
        self.now.strain = Gaussian { mean, variance };
        Ok(flags | flag::of(doubts))
    }

    /// How far readings have jumped, where the filter is to look again.
    fn startled(&mut self, reading: T, nis: T) -> Option<T> {
        let now = &mut self.now;
        now.startling = if nis > T::of(STARTLING_NIS) { now.startling.saturating_add(1) } else { 0 };
        let jump = now.calm.map(|calm| reading - calm).filter(|jump| jump.abs() > now.seen.jump());
        now.calm = if nis > T::of(SURPRISING_NIS) { now.calm } else { Some(reading) };
        jump.filter(|_| now.startling == BESIDE_AFTER)
    }

    /// Prepares the steps that `dt_s` seconds are divided into; how many they are.
    fn prepare(&mut self, dt_s: T) -> u32 {
        let (mut count, mut covered) = (1, self.longest_step_s);
        while covered < dt_s && count < MOST_STEPS {
            covered += self.longest_step_s;
            count += 1;
        }
        let step_s = dt_s / T::of(f64::from(count));
        if step_s != self.now.step_s {
            self.now.moving.set_step(step_s, &(self.numbers)(step_s));
            self.now.step_s = step_s;
        }
        count
    }

    /// Takes a reading, unless it is refused; flags, and its normalised innovation squared as it came.
    fn taken(&mut self, reading: Option<Reading<T>>) -> Result<(u32, T), StepError> {
        let count = self.now.moving.count();
        self.work[usize::from(reading.is_none())] += count;
        let mut refused = 0;
        if let Some(reading) = reading {
            if let Ok(taken) = self.now.moving.take(reading) {
                // What surprises is taken twice.
                self.work[0] += if taken.0 == 0 { 0 } else { count };
                return Ok(taken);
            }
            refused = flag::REJECTED;
        }
        self.now.moving.step(None)?;
        Ok((refused, T::zero()))
    }

    /// The filter's strain, moved into the limits.
    fn filtered(&self) -> Gaussian<T> {
        let belief = self.now.moving.moments();
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
        self.now.strain
    }

    /// The filter's strain, corrected.
    fn corrected(&self) -> Gaussian<T> {
        let filtered = self.filtered();
        let (Some(learned), Some(features)) = (&self.correction, self.now.features) else { return filtered };
        let belief = self.now.moving.moments();
        let relaxation = (2..2 + B).fold(T::zero(), |sum, i| sum + belief.mean[i]);
        let baseline = if N == B + 3 { belief.mean[N - 1] } else { T::zero() };
        let [extend, _, retract] = self.now.moving.phases();
        let outputs = [filtered.mean, belief.mean[1], relaxation, baseline, extend, retract];
        let mut inputs = [T::zero(); INPUTS];
        inputs.iter_mut().zip(outputs.iter().chain(&features)).for_each(|(place, input)| *place = *input);
        let strain = learned.correct(&inputs, filtered, self.now.doubts.birge());
        let grown = (filtered.variance - self.now.known_variance).max(T::zero());
        if self.now.missing { Gaussian { variance: strain.variance + grown, ..strain } } else { strain }
    }
}
