//! Doubts that widen a filter's own interval, in any precision.

use super::{Flag, Flags, Innovations, NEVER_READ_S, RestSeen, RestWatch, SURPRISING_NIS, TurnSeen, TurnWatch, Unread};
use crate::{Gaussian, Recordable};

/// Constants of the widened intervals, also for programs that generate a filter in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtNumbers {
    /// Time constant, s, with which the doubt due to readings beyond those of the largest strains decays; a body reaches such
    /// strains from time to time. A third of it applies to readings beyond the side of rest, and to the mean of normalised
    /// innovations squared; a twelfth to the doubt due to a start or a fault.
    pub far_fades_s: f64,
    /// Factor on the distance of readings outside the calibrated range on the side of rest. A sensor that has not moved for a long
    /// time starts there and soon leaves it.
    pub near_counts: f64,
    /// Factor on the distance of readings outside on the other side. Only a changed R₀, a changed gain or a strain beyond the
    /// calibration leads there. If all readings are off, only those at an end of their range show it, and only in part.
    pub far_counts: f64,
    /// Tolerance of readings outside the calibrated range, as a fraction of it.
    pub margin: f64,
    /// Factor on the fastest rate of calibration, its 99th percentile, beyond which a rate is flagged.
    pub faster: f64,
    /// Fraction of the filter's variance, or of the doubt at a start, beyond which a doubt raises a flag.
    pub worth: f64,
    /// Tolerance around zero strain, as a fraction of the span.
    pub zero: f64,
}

/// Constants of the widened intervals.
pub const DOUBT: DoubtNumbers = DoubtNumbers {
    far_fades_s: 60.0,
    near_counts: 0.5,
    far_counts: 1.5,
    margin: 0.02,
    faster: 1.5,
    worth: 0.2,
    zero: 0.01,
};

/// Calibration values on which the doubts of a sensor depend.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DoubtParts<T> {
    /// Range of the readings, R/R₀ - 1.
    pub low: T,
    /// See [`Self::low`].
    pub high: T,
    /// Fastest rate, 1/s.
    pub fastest_per_s: T,
    /// Longest recording, s.
    pub longest_s: T,
    /// Range of the strain divided by that of the readings: the mean slope.
    pub per_reading: T,
    /// Variance of the strain at an unknown start.
    pub start: T,
    /// Largest variance of doubts: that of a strain anywhere in the limits, or `unstated` if larger.
    pub most: T,
    /// Variance of the strain beyond the stated one: from the uncertainty of a session's R₀, and from errors on held-out rows of
    /// the calibration.
    pub unstated: T,
    /// Bounds on the strain while there is no reading.
    pub unread: Unread<T>,
    /// Readings of the sensor at rest in calibration, if known.
    pub rest: Option<RestSeen<T>>,
    /// Turns of the readings in calibration, if known.
    pub turns: Option<TurnSeen<T>>,
}

impl DoubtParts<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> DoubtParts<T> {
        DoubtParts {
            low: T::of(self.low),
            high: T::of(self.high),
            fastest_per_s: T::of(self.fastest_per_s),
            longest_s: T::of(self.longest_s),
            per_reading: T::of(self.per_reading),
            start: T::of(self.start),
            most: T::of(self.most),
            unstated: T::of(self.unstated),
            unread: self.unread.to(),
            rest: self.rest.map(|rest| rest.to()),
            turns: self.turns.map(|turns| turns.to()),
        }
    }
}

/// Factors by which earlier doubts have decayed after a row, for three time constants; computed from one exponential.
struct Left<T> {
    /// 60 s.
    far: T,
    /// 20 s: readings beyond the calibrated ones on the side of rest, or off their predictions.
    lately: T,
    /// 5 s: a filter that has just started, or restarted.
    soon: T,
}

impl<T: Recordable> Left<T> {
    fn after(passed_s: T) -> Self {
        let far = (-passed_s / T::of(DOUBT.far_fades_s)).falling();
        let lately = far * far * far;
        let twice = lately * lately;
        Self { far, lately, soon: twice * twice }
    }
}

/// Recent misfit of the sensor's law.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Misfit<T> {
    /// Distances of readings outside the calibrated range, on the side of rest and on the other side, R/R₀ - 1; they decay with
    /// time.
    pub(crate) near: T,
    pub(crate) far: T,
    pub(crate) innovations: Innovations<T>,
}

impl<T: Recordable> Misfit<T> {
    /// Takes a reading R/R₀ - 1 and its normalised innovation squared.
    fn see(&mut self, parts: &DoubtParts<T>, left: &Left<T>, reading: T, nis: T) {
        let DoubtParts { low, high, .. } = *parts;
        let margin = T::of(DOUBT.margin) * (high - low);
        let (above, below) = (reading - high - margin, low - reading - margin);
        let (near, far) = match parts.rest.map_or(T::zero(), |rest| rest.sign) {
            grows if grows > T::zero() => (below, above),
            falls if falls < T::zero() => (above, below),
            _ => (T::zero(), above.max(below)),
        };
        self.near = (self.near * left.lately).max(near);
        self.far = (self.far * left.far).max(far);
        self.innovations.see(left.lately, nis);
    }

    /// Returns the variance of the strain for readings outside the calibrated range.
    fn outside(&self, parts: &DoubtParts<T>) -> T {
        let per_reading = parts.per_reading;
        let (near, far) =
            (T::of(DOUBT.near_counts) * self.near * per_reading, T::of(DOUBT.far_counts) * self.far * per_reading);
        near * near + far * far
    }
}

/// Uncertainty that a filter does not state by itself: after a start or restart, after a jump of the readings, outside the
/// calibrated range, or if the law does not fit. Doubts widen the strain's interval, and raise flags with the reason.
///
/// ```
/// use ohmstrain_ekf::Gaussian;
/// use ohmstrain_ekf::live::{DoubtParts, Doubts, Flag, Unread};
/// use ohmstrain_model::StrainRange;
///
/// let unread = Unread::new(2.0, 0.02, StrainRange { lower: 0.0, upper: 0.3 });
/// let parts = DoubtParts {
///     low: 0.0,
///     high: 1.0,
///     fastest_per_s: 0.1,
///     longest_s: 600.0,
///     per_reading: 0.3,
///     start: 0.03 * 0.03,
///     most: unread.anywhere,
///     unstated: 0.0,
///     unread,
///     rest: None,
///     turns: None,
/// };
/// let mut doubts = Doubts::<f64>::new(parts);
/// let stated = Gaussian { mean: 0.1, variance: 1e-5 };
/// let variance = doubts.see(0.0, Some((parts.low, 1.0)), stated);
/// let (variance, flags) = doubts.widened(Gaussian { variance, ..stated }, 0.0);
/// assert!(variance > stated.variance && flags.has(Flag::StartUp));
/// ```
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Doubts<T> {
    parts: DoubtParts<T>,
    pub(crate) runs: bool,
    pub(crate) starts: bool,
    /// Time since the first row, s.
    pub(crate) run_s: T,
    /// Variance of the strain that decays while readings do not surprise.
    pub(crate) fading: T,
    /// Time since the last used reading, s; `refused` is true if a reading has been rejected since.
    pub(crate) unread_s: T,
    pub(crate) refused: bool,
    /// The last reading that did not surprise, R/R₀ - 1.
    pub(crate) believed: Option<T>,
    pub(crate) misfit: Misfit<T>,
    /// True if the strain's variance already includes innovations that are larger than stated.
    corrected: bool,
    /// Watch for an R₀ that differs from the calibrated one; `None` if the calibration has no reading at rest.
    pub(crate) rest: Option<RestWatch<T>>,
    /// Watch for holds longer than those of the calibration; `None` if the calibration lacks their duration.
    pub(crate) turns: Option<TurnWatch<T>>,
}

impl<T: Recordable> Doubts<T> {
    /// Starts before the first row.
    #[must_use]
    pub fn new(parts: DoubtParts<T>) -> Self {
        Self {
            parts,
            runs: false,
            starts: true,
            run_s: T::zero(),
            fading: parts.start,
            unread_s: T::of(NEVER_READ_S),
            refused: false,
            believed: None,
            misfit: Misfit { near: T::zero(), far: T::zero(), innovations: Innovations::none() },
            corrected: false,
            rest: parts.rest.map(|seen| RestWatch::new(seen, false)),
            turns: parts.turns.map(TurnWatch::new),
        }
    }

    /// Returns the watch for holds longer than those of the calibration; `None` if the calibration lacks their
    /// duration.
    pub const fn turns(&self) -> Option<&TurnWatch<T>> {
        self.turns.as_ref()
    }

    /// Marks the strain as known at the start; `rests` if it is zero.
    #[must_use]
    pub fn of_known_strain(self, rests: bool) -> Self {
        let rest = self.parts.rest.map(|seen| RestWatch::new(seen, rests));
        Self { starts: false, fading: T::zero(), unread_s: T::zero(), rest, ..self }
    }

    /// Marks the filter's correction as including the size of innovations.
    #[must_use]
    pub fn of_corrected(self) -> Self {
        Self { corrected: true, ..self }
    }

    /// Returns the ratio of observed to stated innovation variance, at least 1, for the correction of the next row.
    pub fn birge(&self) -> T {
        self.misfit.innovations.birge()
    }

    /// Returns the relative deviation of R₀ that readings at rest show, 0 without evidence of one.
    pub fn rest_off(&self) -> T {
        self.rest.map_or(T::zero(), |rest| rest.off())
    }

    /// Clears the doubts about the strain, which is now known.
    pub fn settle(&mut self) {
        (self.fading, self.starts, self.unread_s, self.refused) = (T::zero(), false, T::zero(), false);
        self.turns.iter_mut().for_each(TurnWatch::settle);
    }

    /// Restarts the watch, because the R₀ of the session is now given.
    pub fn restart_rest_watch(&mut self) {
        self.rest.iter_mut().for_each(RestWatch::restart);
    }

    /// Raises the fading variance to `variance`, at most [`DoubtParts::most`], if that is larger.
    fn raise(&mut self, variance: T) {
        let variance = variance.min(self.parts.most);
        if variance > self.fading {
            (self.fading, self.starts) = (variance, false);
        }
    }

    /// Returns the bounds on the strain without readings, and the time since the last reading, s.
    pub const fn unread(&self) -> (Unread<T>, T)
    where
        T: Copy,
    {
        (self.parts.unread, self.unread_s)
    }

    /// Takes a row: a reading that was used, R/R₀ - 1, with its normalised innovation squared, or none. Returns the variance of the
    /// strain: the stated one, or that after the pause of the readings.
    pub fn see(&mut self, dt_s: T, reading: Option<(T, T)>, stated: Gaussian<T>) -> T {
        self.pass(dt_s);
        let Some((rho, nis)) = reading else { return self.open(stated) };
        self.watch_turns(rho);
        self.read(rho, nis);
        stated.variance
    }

    /// True once a reading has been used or the strain has been known.
    pub fn has_begun(&self) -> bool {
        self.unread_s < T::of(NEVER_READ_S)
    }

    /// True after the first row.
    pub const fn runs(&self) -> bool {
        self.runs
    }

    /// Advances to a row `dt_s` seconds after the previous one.
    pub fn pass(&mut self, dt_s: T) {
        let passed_s = if self.runs { dt_s } else { T::zero() };
        self.runs = true;
        self.run_s += passed_s;
        self.unread_s += passed_s;
    }

    /// Notes a rejected reading; its fault may or may not be over when the next reading is used.
    pub fn refuse(&mut self) {
        self.refused = true;
    }

    /// Returns the variance of the strain after the time since the last reading.
    #[must_use]
    pub fn open(&self, stated: Gaussian<T>) -> T {
        self.parts.unread.variance(self.unread_s, stated.mean, stated.variance)
    }

    /// Takes a reading that will be used, R/R₀ - 1, and watches for turns of the readings.
    pub fn watch_turns(&mut self, rho: T) {
        let passed_s = if self.has_begun() { self.unread_s } else { T::zero() };
        self.turns.iter_mut().for_each(|turns| {
            turns.see(passed_s, rho);
        });
    }

    /// Takes a reading that was used. Only the time since the previous reading counts, in any number of rows.
    ///
    /// After a pause of t seconds, the doubt is the standard deviation at a start times (1 - exp(-t/5 s))²: none after a single
    /// lost reading, all of it after half a minute. After rejected or stuck readings, it is the distance that a body can have moved
    /// in the meantime.
    pub fn read(&mut self, rho: T, nis: T) {
        let passed_s = if self.has_begun() { self.unread_s } else { T::zero() };
        self.unread_s = T::zero();
        let (surprising, left) = (T::of(SURPRISING_NIS), Left::after(passed_s));
        let forgotten = T::one() - left.soon;
        let share = forgotten * forgotten;
        if nis > surprising {
            if let Some(last) = self.believed {
                let jump = (rho - last) * self.parts.per_reading;
                let doubt = (T::one() - (surprising / nis).sqrt()) * jump;
                self.raise(doubt * doubt);
            }
        } else {
            self.fading *= left.soon;
            self.believed = Some(rho);
        }
        self.raise(self.parts.start * (share * share));
        if core::mem::replace(&mut self.refused, false) {
            self.raise(self.parts.unread.variance(passed_s, self.parts.unread.centre, T::zero()));
        }
        self.judge(&left, passed_s, rho, nis);
    }

    /// Takes a row in a smoother's backward pass, which has no doubts due to a fault; a start in an unknown strain is doubted as in a
    /// filter. The row is `run_s` after the first row and `dt_s` before the next reading; `unturned_s` is the time between the turns of
    /// the readings before and after it.
    pub fn see_back(&mut self, run_s: T, dt_s: T, unturned_s: T, reading: Option<(T, T)>) {
        let of_start = if self.starts { self.parts.start * Left::after(run_s).soon } else { T::zero() };
        (self.run_s, self.fading) = (run_s, of_start);
        self.turns.iter_mut().for_each(|turns| turns.lasts(unturned_s));
        if let Some((rho, nis)) = reading {
            self.judge(&Left::after(dt_s), dt_s, rho, nis);
        }
    }

    /// Updates the doubts about the law and R₀ with a reading.
    fn judge(&mut self, left: &Left<T>, passed_s: T, rho: T, nis: T) {
        self.misfit.see(&self.parts, left, rho, nis);
        self.rest.iter_mut().for_each(|rest| {
            rest.see(passed_s, rho);
        });
    }

    /// Returns the variance of a stated strain with all doubts, and their flags. Readings outside the calibrated range widen it by a
    /// multiple of their distance times the mean slope. If readings have not turned for longer than in calibration, the variance
    /// grows to that of a strain anywhere in the limits, or to the squared strain if they are readings at rest. Innovations larger
    /// than stated widen the interval as in a weighted mean (Birge, *Phys. Rev.* 40 (1932) 207), unless a correction already
    /// includes them. A rate beyond the calibrated one also widens it. The multiplied variance and the sum of the other doubts are
    /// each limited to [`DoubtParts::most`].
    pub fn widened(&self, strain: Gaussian<T>, rate: T) -> (T, Flags) {
        let Gaussian { mean, variance } = strain;
        let (worth, most, per_reading) = (T::of(DOUBT.worth), self.parts.most, self.parts.per_reading);
        let faster = rate.abs() / self.parts.fastest_per_s;
        let is_fast = faster > T::of(DOUBT.faster);
        let birge = self.birge();
        let of_innovations = if self.corrected { T::one() } else { birge };
        let times = if is_fast { of_innovations * (faster * faster) } else { of_innovations };
        let stated = (variance * times).min(most).max(variance);
        let outside = self.misfit.outside(&self.parts);
        let rest_off = self.rest_off();
        let elsewhere = rest_off * per_reading;
        let rests = self.rest.is_some_and(|rest| rest.near_s > T::zero());
        let doubted = self.turns.map_or(T::zero(), |turns| turns.doubted());
        let unseen = doubted * doubted * if rests { most.min(mean * mean) } else { most };
        let more = (self.fading + outside + elsewhere * elsewhere + unseen + self.parts.unstated).min(most);
        let is_beyond = is_fast || outside + unseen > worth * variance || birge > T::one() + worth;
        let flags = Flags::NONE
            .with(Flag::StartUp, self.starts && self.fading > worth * self.parts.start)
            .with(Flag::Recovering, !self.starts && self.fading > worth * variance)
            .with(Flag::Extrapolated, is_beyond)
            .with(Flag::LongRun, self.run_s > self.parts.longest_s)
            .with(Flag::RestMoved, rest_off > T::zero());
        (stated + more, flags)
    }

    /// Converts a variance of the strain to one of a reading R/R₀ - 1, with the mean slope of the calibration.
    pub fn of_reading(&self, variance: T) -> T {
        variance / (self.parts.per_reading * self.parts.per_reading)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec;

    use super::{DoubtParts, Doubts, Flag, Flags, RestSeen, TurnSeen, Unread};
    use crate::Gaussian;

    const STATED: Gaussian<f64> = Gaussian { mean: 0.1, variance: 1e-6 };

    /// Returns doubts for readings of 0 to 1 and strains of 0 to 0.3, with rest at the end given by `sign`.
    fn parts(sign: f64) -> DoubtParts<f64> {
        let anywhere = 0.3 * 0.3 / 12.0;
        let unread = Unread { rate_time_s: 1.0, path_variance: 1e-3, centre: 0.15, anywhere };
        let end = if sign < 0.0 { 1.0 } else { 0.0 };
        let rest = RestSeen { rested: end, tolerance: 10.0, lasts_s: 10.0, sign, end };
        let (per_reading, start, most) = (0.3, 1e-4, anywhere);
        DoubtParts {
            low: 0.0,
            high: 1.0,
            fastest_per_s: 1.0,
            longest_s: 1e9,
            per_reading,
            start,
            most,
            unstated: 0.0,
            unread,
            rest: Some(rest),
            turns: None,
        }
    }

    /// Returns the variance and flags after rows every 0.1 s of readings with normalised innovations squared.
    fn widened_after(parts: DoubtParts<f64>, rows: impl IntoIterator<Item = (f64, f64)>) -> (f64, Flags) {
        let mut doubts = Doubts::new(parts).of_known_strain(false);
        rows.into_iter().for_each(|row| {
            doubts.see(0.1, Some(row), STATED);
        });
        doubts.widened(STATED, 0.0)
    }

    #[test]
    fn innovations_that_are_larger_than_stated_widen_as_much() {
        // After 200 s the mean has settled to exp(-10).
        for (nis, times) in [(0.5, 1.0), (1.0, 1.0), (4.0, 4.0), (1e6, 30.0)] {
            // No jump: all readings are equal.
            let (variance, flags) = widened_after(parts(1.0), vec![(0.5, nis); 2000]);
            assert!((variance / STATED.variance / times - 1.0).abs() < 1e-3, "{nis}: {variance}");
            assert_eq!(flags.has(Flag::Extrapolated), times > 1.0);
        }
        // With a correction, innovations do not widen the interval again.
        let mut doubts = Doubts::new(parts(1.0)).of_known_strain(false).of_corrected();
        (0..2000).for_each(|_| {
            doubts.see(0.1, Some((0.5, 4.0)), STATED);
        });
        let (variance, flags) = doubts.widened(STATED, 0.0);
        // Rows 0.1 s apart are pauses of 0.1 s.
        let stated = STATED.variance + 1e-4 * (1.0 - (-0.1_f64 / 5.0).exp()).powi(4);
        assert!((doubts.birge() - 4.0).abs() < 1e-3 && (variance - stated).abs() < 1e-12, "{variance}");
        assert!(flags.has(Flag::Extrapolated));
        // One outlier among readings that fit: capped at 30, for a two-hundredth of the time.
        let outlier = |k: usize| (0.5, if k == 1990 { 1e6 } else { 0.5 });
        let (variance, flags) = widened_after(parts(1.0), (0..2000).map(outlier));
        assert!((variance - stated).abs() < 1e-12 && flags == Flags::NONE, "{variance} {flags}");
    }

    /// Readings that turned every 10 s stand still for 13.5 s: halfway from 12 to 15 s, whether they are readings at rest or not.
    #[test]
    fn holds_longer_than_those_of_calibration_leave_the_limits_or_rest() {
        let still = |rests: bool, of_limits: bool| {
            let turns = Some(TurnSeen { turn: 0.1, longest_s: 10.0 });
            let most = if of_limits { 0.0075 } else { 1.0 };
            let rows = vec![(if rests { 0.05 } else { 0.5 }, 0.1); 136];
            let parts = DoubtParts {
                turns,
                most,
                rest: parts(1.0).rest.map(|rest| RestSeen { tolerance: 0.1, ..rest }),
                ..parts(1.0)
            };
            let (variance, flags) = widened_after(parts, rows);
            assert!(flags.has(Flag::Extrapolated));
            // Rows 0.1 s apart are pauses of 0.1 s.
            variance - STATED.variance - 1e-4 * (1.0 - (-0.1_f64 / 5.0).exp()).powi(4)
        };
        assert!((still(false, true) - 0.0075 / 4.0).abs() < 1e-9);
        // The strain is 0.1 away from rest.
        assert!((still(true, false) - 0.01 / 4.0).abs() < 1e-9);
        assert!((still(true, true) - 0.0075 / 4.0).abs() < 1e-9);
    }

    /// Ten seconds after a reading 0.12 beyond the margin, compared with exponentials computed here.
    #[test]
    fn readings_beyond_the_largest_strain_count_more_and_longer_than_those_beyond_rest() {
        let after = |beyond: f64| std::iter::once((beyond, 0.1)).chain(vec![(0.5, 0.1); 100]);
        let near = (0.5 * 0.12 * 0.3 * (-10.0_f64 / 20.0).exp()).powi(2);
        let far = (1.5 * 0.12 * 0.3 * (-10.0_f64 / 60.0).exp()).powi(2);
        for (sign, above, below) in [(1.0, far, near), (-1.0, near, far), (0.0, far, far)] {
            for (reading, expected) in [(1.14, above), (-0.14, below), (1.02, 0.0)] {
                let (variance, flags) = widened_after(parts(sign), after(reading));
                assert!(
                    (variance - STATED.variance - expected).abs() < 1e-9,
                    "{sign} {reading}: {variance} {expected}"
                );
                assert_eq!(flags.has(Flag::Extrapolated), expected > 0.0);
            }
        }
        // At most the variance of a strain anywhere in the limits.
        assert!((widened_after(parts(1.0), after(9.0)).0 - STATED.variance - 0.0075).abs() < 1e-12);
    }
}
