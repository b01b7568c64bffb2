use ohmstrain_model::{MOTION_STATES, StrainRange};

use super::memory::{Memory, Moment};
use super::{
    BESIDE_SHARE, Correct, DOUBT, Doubts, FARTHEST_REST, FaultWatch, Flags, LiveParts, Protections, RestFollower,
    SURPRISING_NIS, SensorEstimator, Sieve, StaticCurve,
};
use crate::clock::check_time_step;
use crate::correction::filter_inputs;
use crate::substeps::{LONGEST_PAUSE_S, Pause, Repeated};
use crate::{
    Belief, Gaussian, Guard, Influence, PastStep, Reading, ReadingVerdict, Real, Recordable, State, StepError, Substeps,
};

/// Tolerance beyond the limits for a known strain, in spans.
///
/// ```
/// // Of a sensor of 0 to 30 % one may know 33 %.
/// assert!((0.3 * (1.0 + ohmstrain_ekf::live::KNOWN_BEYOND) - 0.33_f64).abs() < 1e-12);
/// ```
pub const KNOWN_BEYOND: f64 = 0.1;

/// Returns a pause of zero length, at a reading.
fn at_reading<T: Real, E: SensorEstimator<T, N, L>, C, const N: usize, const L: usize>(
    estimator: &Substeps<E>,
    parts: &LiveParts<T, C>,
) -> Pause<T> {
    Pause::none(estimator.0.longest_step_s().min(parts.longest_step_s))
}

/// Estimate of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LiveEstimate<T> {
    /// Strain, within the limits.
    pub strain: Gaussian<T>,
    /// Its rate, 1/s.
    pub rate: Gaussian<T>,
    /// Flags: the verdict on the reading, and the doubts.
    pub flags: Flags,
}

/// A row: its estimate, and additional data for a smoother or a fixed lag.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(deserialize = "T: Real + serde::Deserialize<'de>, S: serde::Deserialize<'de>"))
)]
pub struct LiveRow<T, S> {
    /// The estimate.
    pub estimate: LiveEstimate<T>,
    /// The strain before doubts.
    pub stated: Gaussian<T>,
    /// Flags raised by doubts.
    pub doubts: Flags,
    /// The row's reading, and its use by the filter.
    pub measured: Measured<T>,
    /// The state predicted at a row without a used reading. With a used reading, the state is that of the filter
    /// ([`LiveFilter::state`]).
    pub look: Option<S>,
    /// The pause up to this row, before its whole steps were passed.
    pub pause: Pause<T>,
}

impl<T, S> LiveRow<T, S> {
    /// Converts the state.
    ///
    /// # Errors
    /// The error of the conversion.
    pub fn try_map<R, E>(self, convert: impl FnOnce(S) -> Result<R, E>) -> Result<LiveRow<T, R>, E> {
        let Self { estimate, stated, doubts, measured, look, pause } = self;
        Ok(LiveRow { estimate, stated, doubts, measured, look: look.map(convert).transpose()?, pause })
    }
}

/// A reading, and its use by the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Measured<T> {
    /// The verdict on the reading.
    pub verdict: ReadingVerdict,
    /// The reading, R/R₀ - 1 with R₀ as tracked; `None` if there was none.
    pub reading: Option<Reading<T>>,
    /// The reading with the noise assigned by the filter; `None` if it was not used.
    pub used: Option<Reading<T>>,
    /// Normalised innovation squared of the original reading; `None` if it was not compared.
    pub nis: Option<T>,
    /// Jump of the readings, if it caused a second look: at the second reading in a row beyond five standard
    /// deviations, and farther than [`Sieve::jump`] from the last one that did not surprise.
    pub jumped: Option<T>,
    /// True for the first few startling readings in a row, which may be spikes ([`may_be_spike`](super::Jumps::may_be_spike)).
    #[cfg_attr(feature = "serde", serde(default))]
    pub spike: bool,
    /// Factor on the covariance of the state before the step, at a readmission ([`Guard`]).
    inflation: T,
}

impl<T: Real> Measured<T> {
    /// Returns the value for a missing reading.
    #[must_use]
    pub fn nothing() -> Self {
        let verdict = ReadingVerdict::Missing;
        Self { verdict, reading: None, used: None, nis: None, jumped: None, spike: false, inflation: T::one() }
    }

    /// True for a reading that was downweighted because it was far from its expectation.
    pub fn surprises(&self) -> bool {
        self.verdict == ReadingVerdict::Downweighted && self.nis.is_none_or(|nis| nis > T::of(SURPRISING_NIS))
    }

    /// Returns the strain of the reading on a curve; `None` if it was not used, or may be a spike.
    pub fn on_curve(&self, curve: &StaticCurve<T>) -> Option<Gaussian<T>> {
        self.used.filter(|_| !self.spike).map(|used| curve.strain(used.value))
    }
}

/// A sensor's filter with the components around it, in fixed memory.
///
/// Only a used reading advances the state. A row without one is predicted from the last used reading, so that a pause may be one
/// row or many. No time passes before the first row. An error leaves the filter unchanged.
pub struct LiveFilter<T: Real, E: SensorEstimator<T, N, L>, C, const N: usize, const L: usize> {
    estimator: Substeps<E>,
    guard: Guard<T>,
    parts: LiveParts<T, C>,
    /// Curve that gives the strain in place of the estimator.
    curve: Option<StaticCurve<T>>,
    protections: Protections,
    /// Plausibility limits on a reading, under these protections.
    sieve: Sieve<T>,
    /// R₀ of the law, adjusted to the measured reading at rest if one was given.
    rest_reading: T,
    /// Estimator's state before any reading.
    fresh: E::State,
    /// The prepared steps of a pause.
    prepared: (Pause<T>, Repeated<E::Prepared, T>),
    now: Moment<T, E::State>,
    /// State to continue from if a fault ends ([`FaultWatch`]).
    kept: Moment<T, E::State>,
}

impl<T, E, C, const N: usize, const L: usize> LiveFilter<T, E, C, N, L>
where
    T: Real,
    E: SensorEstimator<T, N, L>,
    C: Correct<T>,
{
    /// Creates a filter before any reading.
    #[must_use]
    pub fn new(estimator: E, parts: LiveParts<T, C>) -> Self {
        let fresh = estimator.start(None);
        let estimator = Substeps(estimator);
        let pause = at_reading(&estimator, &parts);
        let usual = pause.after(parts.dt_s);
        let now = Moment::new(&parts, Protections::ALL, (fresh.clone(), pause));
        Self {
            prepared: (usual, estimator.prepare_over(usual)),
            kept: now.clone(),
            now,
            rest_reading: parts.rest_reading,
            guard: guard(Protections::ALL),
            protections: Protections::ALL,
            sieve: parts.sieve,
            estimator,
            parts,
            curve: None,
            fresh,
        }
    }

    /// Sets a curve that gives the strain of a row with a reading, unless that may be a spike, in place of the estimator.
    #[must_use]
    pub fn on_curve(self, curve: Option<StaticCurve<T>>) -> Self {
        Self { curve, ..self }
    }

    /// Turns off some protections, before any reading.
    #[must_use]
    pub fn protected_by(self, protections: Protections) -> Self {
        let now = Moment::new(&self.parts, protections, (self.fresh.clone(), at_reading(&self.estimator, &self.parts)));
        let (guard, sieve, kept) = (guard(protections), self.parts.sieve.under(protections), now.clone());
        Self { guard, protections, sieve, now, kept, ..self }
    }

    /// Sets another guard against outliers.
    #[must_use]
    pub fn guarded_by(self, guard: Guard<T>) -> Self {
        Self { guard, ..self }
    }

    /// The estimator.
    pub const fn estimator(&self) -> &E {
        &self.estimator.0
    }

    /// Returns the uncorrected state at the last used reading, or somewhat later in a long pause.
    pub const fn state(&self) -> &E::State {
        &self.now.state
    }

    /// Returns the state and the doubts from which the filter continues after a fault ([`Self::ends_fault`]).
    pub const fn kept(&self) -> (&E::State, &Doubts<T>) {
        (&self.kept.state, &self.kept.doubts)
    }

    /// Returns the estimator that divides long steps, for backward steps.
    pub const fn substeps(&self) -> &Substeps<E> {
        &self.estimator
    }

    /// Returns the state between steps, for [`Self::return_to`].
    pub fn memory(&self) -> Memory<T, E::State> {
        Memory { now: self.now.clone(), kept: self.kept.clone() }
    }

    /// Restores a state from [`Self::memory`].
    pub fn return_to(&mut self, memory: &Memory<T, E::State>) {
        Memory { now: self.now, kept: self.kept } = memory.clone();
    }

    /// True if the strain is corrected.
    pub const fn is_corrected(&self) -> bool {
        self.parts.learned.is_some()
    }

    /// The doubts after the last row.
    pub const fn doubts(&self) -> &Doubts<T> {
        &self.now.doubts
    }

    /// Returns the relative deviation of the tracked R₀ from the calibrated or given one.
    pub fn rest_off(&self) -> T {
        self.now.follower.map_or(T::zero(), |follower| follower.off())
    }

    /// Clears the doubts about the strain, which is now known.
    pub fn settle(&mut self) {
        self.now.doubts.settle();
        self.kept.doubts.settle();
    }

    /// Advances by the usual time step, with a reading in the unit of the calibration.
    ///
    /// # Errors
    /// If even a prediction is rejected.
    pub fn step(&mut self, reading: T) -> Result<LiveEstimate<T>, StepError> {
        self.step_after(self.parts.dt_s, Some(self.relative(reading, T::zero())))
    }

    /// Advances by the usual time step, without a reading.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn predict(&mut self) -> Result<LiveEstimate<T>, StepError> {
        self.step_after(self.parts.dt_s, None)
    }

    /// Converts a reading in the unit of the calibration, with the standard deviation that its electronics add, to R/R₀ - 1 with
    /// the calibrated R₀, or the one given since.
    pub fn relative(&self, reading: T, reading_sd: T) -> Reading<T> {
        let sd = reading_sd / self.rest_reading;
        Reading { value: (reading - self.rest_reading) / self.rest_reading, extra_variance: sd * sd }
    }

    /// Sets the measured reading of the rested, unstretched sensor, from now on.
    ///
    /// # Errors
    /// If it is not a positive number, or not within a factor of [`FARTHEST_REST`] of the reading at rest in
    /// calibration.
    pub fn rest(&mut self, measured: T) -> Result<(), StepError> {
        self.rest_reading = self.rest_reading_at(measured)?;
        self.now.follower = None;
        self.now.doubts.restart_rest_watch();
        self.now.faults = FaultWatch::new();
        Ok(())
    }

    /// Restarts with the sensor at rest, unstretched, and its reading `measured`.
    ///
    /// # Errors
    /// As [`Self::rest`].
    pub fn rezero(&mut self, measured: T) -> Result<(), StepError> {
        self.rest_reading = self.rest_reading_at(measured)?;
        // If the sensor is always stretched, its strain at rest is unknown.
        self.start_at(may_be_unstretched(&self.parts.limits).then(T::zero));
        self.now.follower = None;
        Ok(())
    }

    /// Restarts, at a known strain if there is one.
    pub fn start_at(&mut self, strain: Option<T>) {
        let known = strain.map(|mean| Gaussian { mean, variance: self.parts.known_variance });
        let start = (self.estimator.0.start(known), at_reading(&self.estimator, &self.parts));
        self.now = Moment::new(&self.parts, self.protections, start);
        if let Some(strain) = strain {
            let is_at_rest = strain.abs() <= T::of(DOUBT.zero) * self.parts.limits.span();
            self.now.doubts = self.now.doubts.of_known_strain(is_at_rest);
            if !is_at_rest {
                self.now.follower = self.now.follower.map(RestFollower::stretched);
            }
        }
    }

    fn rest_reading_at(&self, measured: T) -> Result<T, StepError> {
        if !(measured > T::zero() && measured.is_finite()) {
            return Err(StepError::NonFiniteReading);
        }
        let times = measured / self.parts.rested;
        let is_plausible = times <= T::of(FARTHEST_REST) && times >= T::of(1.0 / FARTHEST_REST);
        if is_plausible { Ok(self.parts.rest_reading * times) } else { Err(StepError::ImplausibleRest) }
    }

    /// Advances by `dt_s` seconds, with a reading ([`Self::relative`]) or without; no time passes before the first row.
    ///
    /// # Errors
    /// As [`Self::step`]; or if `dt_s` is negative or not finite.
    pub fn step_after(&mut self, dt_s: T, reading: Option<Reading<T>>) -> Result<LiveEstimate<T>, StepError> {
        self.row_after(dt_s, reading).map(|row| row.estimate)
    }

    /// True if a fault ends with this reading, `dt_s` seconds from now: [`Self::row_after`] then continues from the state before the
    /// fault, as if the readings in between were missing. If these showed that R₀ is another one, they were no fault.
    pub fn ends_fault(&self, dt_s: T, reading: Option<Reading<T>>) -> bool {
        let rest_off = |moment: &Moment<T, E::State>| moment.doubts.rest_off();
        rest_off(&self.now) == rest_off(&self.kept)
            && reading.is_some_and(|reading| self.now.faults.is_over(dt_s, reading.value, &self.sieve))
    }

    /// Takes a row, and returns all of its results.
    ///
    /// # Errors
    /// As [`Self::step_after`].
    #[inline]
    pub fn row_after(&mut self, dt_s: T, reading: Option<Reading<T>>) -> Result<LiveRow<T, E::State>, StepError> {
        check_time_step(dt_s)?;
        let (mut passed_s, mut faulty) = (dt_s, None);
        if self.ends_fault(dt_s, reading) {
            passed_s += self.now.faults.kept_s;
            faulty = Some(core::mem::replace(&mut self.now, self.kept.clone()));
            self.now.doubts.refuse();
        }
        let row = self.row_of(passed_s, reading);
        if let (Err(_), Some(faulty)) = (&row, faulty) {
            self.now = faulty;
        }
        row
    }

    fn row_of(&mut self, dt_s: T, reading: Option<Reading<T>>) -> Result<LiveRow<T, E::State>, StepError> {
        // The square of a much longer time would overflow in single precision.
        let dt_s = if self.now.doubts.runs() { dt_s.min(T::of(LONGEST_PAUSE_S)) } else { T::zero() };
        let (measured, look, pause) = self.take(dt_s, reading)?;
        let moments = look.as_ref().unwrap_or(&self.now.state).moments();
        let filtered = self.filtered(&moments);
        self.watch(dt_s, &measured, filtered);
        let on_curve = self.curve.and_then(|curve| measured.on_curve(&curve));
        let corrected = || self.corrected(look.as_ref().unwrap_or(&self.now.state), &moments, filtered);
        let stated = on_curve.unwrap_or_else(corrected);
        let now = &mut self.now;
        // The estimator's surprise says nothing about a curve.
        let nis = measured.nis.filter(|_| on_curve.is_none()).unwrap_or(T::zero());
        let taken = reading.filter(|_| measured.used.is_some()).map(|reading| (reading.value, nis));
        now.faults.pass(dt_s);
        let within = |reading| now.follower.is_none_or(|follower| follower.is_within(reading));
        if let Some((reading, _)) = taken {
            now.faults.see(reading, measured.jumped, within(reading), self.sieve.jump);
        } else if measured.verdict == ReadingVerdict::Implausible {
            now.faults.see_implausible(now.faults.last.is_some_and(within));
        }
        if let (Some(follower), Some((reading, _)), false) = (&mut now.follower, taken, now.faults.is_fault()) {
            follower.see(now.doubts.unread_s + dt_s, reading);
        }
        let of_session = |reading| now.follower.map_or(reading, |follower| follower.of_session(reading));
        let doubted = taken.map(|(reading, nis)| (of_session(reading), nis));
        if measured.verdict.is_refused() {
            now.doubts.refuse();
        }
        let open = now.doubts.see(dt_s, doubted, stated);
        let (widened, doubts) = now.doubts.widened(Gaussian { variance: open, ..stated }, moments.mean[1]);
        let (variance, doubts) =
            if self.protections.doubts { (widened, doubts) } else { (stated.variance, Flags::NONE) };
        if measured.verdict == ReadingVerdict::Accepted && now.faults.is_due() {
            self.kept = now.clone();
        }
        let strain = Gaussian { variance, ..stated };
        let flags = Flags::of(measured.verdict).and(doubts);
        let estimate = LiveEstimate { strain, rate: Gaussian::marginal(&moments, 1), flags };
        Ok(LiveRow { estimate, stated, doubts, measured, look, pause })
    }

    /// Returns the step of the last row from the state `before` it, if its reading was used ([`LiveRow::measured`]).
    pub fn past_step(
        &self,
        before: &E::State,
        measured: &Measured<T>,
    ) -> PastStep<E::State, Repeated<E::Prepared, T>, T> {
        let from = if measured.inflation > T::one() { before.inflated(measured.inflation) } else { before.clone() };
        PastStep { from, prepared: self.prepared.1, reading: measured.used }
    }

    /// Takes a reading if it is plausible, and a second look if readings have jumped. For a row without a used reading, also
    /// returns the state predicted from the last one, and the pause up to it.
    #[allow(clippy::type_complexity, reason = "parts of a row")]
    fn take(
        &mut self,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<(Measured<T>, Option<E::State>, Pause<T>), StepError> {
        let mut repeats = self.now.repeats;
        repeats.pass(dt_s);
        let reading = reading.map(|reading| self.now.follower.map_or(reading, |follower| follower.relative(reading)));
        let sieved = reading.map(|reading| repeats.sieved(&self.sieve, reading, self.parts.reading_variance));
        let (seen, turned_down) = match sieved.transpose() {
            Ok(seen) => (seen, None),
            Err(verdict) => (None, Some(verdict)),
        };
        // No time passes before the first reading.
        let since = if self.now.doubts.has_begun() { self.now.pause.after(dt_s) } else { self.now.pause };
        let (mut pause, mut moved) = (since, None);
        if seen.is_none() && pause.clone().whole_step().is_some() {
            let state = moved.insert(self.now.state.clone());
            self.estimator.pass_whole(state, &mut pause)?;
        }
        self.prepare(pause);
        let now = &mut self.now;
        let from = moved.as_ref().unwrap_or(&now.state);
        let guarded = self.guard.advance(&self.estimator, from, now.streak, &self.prepared.1, seen)?;
        let verdict = turned_down.unwrap_or(guarded.verdict);
        let nis = guarded.advanced.innovation.map(|innovation| innovation.nis);
        let (used, inflation) = (guarded.used.filter(|_| verdict.is_taken()), guarded.inflation);
        let mut measured = Measured { verdict, reading, used, nis, jumped: None, spike: false, inflation };
        let jumped =
            seen.filter(|_| measured.used.is_some() && verdict != ReadingVerdict::Readmitted).and_then(|seen| {
                let nis = nis.unwrap_or(T::zero());
                now.jumps.see(seen.value, nis, self.sieve.jump)
            });
        measured.jumped = jumped.filter(|_| measured.surprises());
        let is_watched = measured.used.is_some() && verdict != ReadingVerdict::Readmitted;
        measured.spike = is_watched && now.jumps.may_be_spike();
        (now.repeats, now.streak) = (repeats, guarded.streak);
        let look = if measured.used.is_some() {
            (now.state, now.pause) = (guarded.advanced.state, at_reading(&self.estimator, &self.parts));
            None
        } else {
            now.pause = pause;
            moved.into_iter().for_each(|moved| now.state = moved);
            Some(guarded.advanced.state)
        };
        if measured.jumped.is_some() {
            now.state = now.state.beside(&self.fresh, T::of(BESIDE_SHARE));
        }
        Ok((measured, look, since))
    }

    /// Prepares the steps of a pause, unless they are already prepared.
    fn prepare(&mut self, pause: Pause<T>) {
        let pause = self.estimator.with_merged_length(pause);
        if pause != self.prepared.0 {
            self.prepared = (pause, self.estimator.prepare_over(pause));
        }
    }

    /// Passes a reading used by the filter to the correction.
    fn watch(&mut self, dt_s: T, measured: &Measured<T>, filtered: Gaussian<T>) {
        if let Some(watched) = &mut self.now.watched {
            watched.step_unless(measured.surprises(), dt_s, measured.used.map(|used| used.value));
            if !watched.is_waiting() {
                self.now.known_variance = filtered.variance;
            }
        }
    }

    /// Returns the filter's strain, clamped to the limits.
    fn filtered(&self, belief: &Belief<T, N, L>) -> Gaussian<T> {
        reported(Gaussian::marginal(belief, 0), self.parts.strain_sd_scale, &self.parts.limits)
    }

    /// Returns the corrected strain of the filter. While readings are missing, its variance grows as much as the filter's has
    /// since the last one.
    fn corrected(&self, state: &E::State, belief: &Belief<T, N, L>, filtered: Gaussian<T>) -> Gaussian<T> {
        let (Some((_, learned)), Some(watched)) = (&self.parts.learned, &self.now.watched) else { return filtered };
        let Some(features) = watched.now() else { return filtered };
        let (first, end) = (MOTION_STATES, MOTION_STATES + E::BRANCHES);
        let relaxation = (first..end).fold(T::zero(), |sum, i| sum + belief.mean[i]);
        let baseline = if N > end { belief.mean[end] } else { T::zero() };
        let [extend, _, retract] = state.phases().unwrap_or([T::zero(); 3]);
        let outputs = [filtered.mean, belief.mean[1], relaxation, baseline, extend, retract];
        let strain = learned.correct(&filter_inputs(&outputs, &features), filtered, self.now.doubts.birge());
        let grown = (filtered.variance - self.now.known_variance).max(T::zero());
        if watched.is_waiting() { Gaussian { variance: strain.variance + grown, ..strain } } else { strain }
    }
}

impl<T, E, C, const N: usize, const L: usize> Clone for LiveFilter<T, E, C, N, L>
where
    T: Real,
    E: SensorEstimator<T, N, L> + Clone,
    C: Clone,
{
    fn clone(&self) -> Self {
        let (estimator, fresh, now) = (self.estimator.clone(), self.fresh.clone(), self.now.clone());
        Self { estimator, fresh, now, kept: self.kept.clone(), parts: self.parts.clone(), ..*self }
    }
}

impl<T, E, C, const N: usize, const L: usize> Copy for LiveFilter<T, E, C, N, L>
where
    T: Real,
    E: SensorEstimator<T, N, L, State: Copy> + Copy,
    C: Copy,
{
}

/// Returns a filter's strain as reported: clamped to the limits, with its standard deviation times a factor, and its
/// variance not negative.
#[must_use]
pub fn reported<T: Recordable>(strain: Gaussian<T>, sd_scale: T, limits: &StrainRange<T>) -> Gaussian<T> {
    let variance = strain.variance.max(T::zero()) * sd_scale * sd_scale;
    Gaussian { mean: strain.mean, variance }.clamped(limits)
}

/// True if the strain may be zero: zero lies within the limits, or slightly beyond.
#[must_use]
pub fn may_be_unstretched<T: Real>(limits: &StrainRange<T>) -> bool {
    limits.lower.max(-limits.upper) <= T::of(KNOWN_BEYOND) * limits.span()
}

fn guard<T: Real>(protections: Protections) -> Guard<T> {
    let whole = Guard::none();
    let influence = Influence::Redescending { threshold: T::of(SURPRISING_NIS).sqrt() };
    if protections.influence { whole.with_influence(influence).unwrap_or(whole) } else { whole }
}
