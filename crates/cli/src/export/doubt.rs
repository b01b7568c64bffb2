//! When an interval is wider than the filter says: the library's doubts, in any precision.

use ohmstrain::{DOUBT, NEVER_READ_S, RestSeen, RestWatch, Unread};
use ohmstrain_calib::{MotionParams, SURPRISING_NIS, SensorParams};
use ohmstrain_ekf::{Gaussian, Real};

use super::twin::{flag, number};

/// What the doubts of a sensor depend on: what its calibration has seen.
#[derive(Clone, Copy)]
pub struct DoubtParts {
    /// Range of the readings, R/R₀ - 1.
    pub low: f64,
    pub high: f64,
    /// Fastest rate, 1/s, and longest recording, s.
    pub fastest_per_s: f64,
    pub longest_s: f64,
    /// Range of the strain over that of the readings.
    pub per_reading: f64,
    /// Variances: at an unknown start, and of what is known least.
    pub start: f64,
    pub most: f64,
    /// What is known without a reading.
    pub unread: Unread,
    /// What the sensor read at rest, if that is known.
    pub rest: Option<RestSeen>,
}

impl DoubtParts {
    /// Of a sensor whose filter runs with that motion.
    pub fn new(params: &SensorParams, motion: &MotionParams) -> Self {
        let (seen, span) = (&params.validity, params.limits.span());
        let relative = |reading: f64| reading / params.rest_reading - 1.0;
        let (low, high) = (relative(seen.reading_lower), relative(seen.reading_upper));
        Self {
            low,
            high,
            fastest_per_s: seen.fastest_rate_per_s,
            longest_s: seen.duration_s,
            per_reading: if high > low { span / (high - low) } else { 0.0 },
            start: (DOUBT.start * span).powi(2),
            most: (DOUBT.most * span).powi(2),
            unread: Unread::new(motion, params.limits),
            rest: RestSeen::of(params),
        }
    }
}

/// Doubts as they are.
#[derive(Clone, Copy)]
pub struct Doubt<T> {
    parts: DoubtParts,
    runs: bool,
    starts: bool,
    run_s: T,
    fading: T,
    unread_s: T,
    lost: Option<T>,
    believed: Option<T>,
    outside: T,
    rest: Option<RestWatch<T>>,
}

impl<T: Real> Doubt<T> {
    /// Before the first row.
    pub fn new(parts: DoubtParts) -> Self {
        Self {
            parts,
            runs: false,
            starts: true,
            run_s: T::zero(),
            fading: number(parts.start),
            unread_s: number(NEVER_READ_S),
            lost: None,
            believed: None,
            outside: T::zero(),
            rest: parts.rest.map(|seen| RestWatch::new(seen, false)),
        }
    }

    /// The same where the strain is known at the start, and whether it is none.
    pub fn of_known_strain(self, rests: bool) -> Self {
        let rest = self.parts.rest.map(|seen| RestWatch::new(seen, rests));
        Self { starts: false, fading: T::zero(), unread_s: T::zero(), rest, ..self }
    }

    fn raise(&mut self, variance: T) {
        let variance = variance.min(number(self.parts.most));
        if variance > self.fading {
            (self.fading, self.starts) = (variance, false);
        }
    }

    /// A step has passed, with a reading that was used and its normalised innovation squared, or without; the variance of
    /// the strain that is stated, or what a pause of the readings leaves open.
    pub fn see(&mut self, dt_s: T, reading: Option<(T, T)>, stated: Gaussian<T>) -> T {
        let passed_s = if self.runs { dt_s } else { T::zero() };
        self.runs = true;
        self.run_s += passed_s;
        self.unread_s = if reading.is_some() { T::zero() } else { self.unread_s + passed_s };
        let Some((rho, nis)) = reading else {
            let variance = self.parts.unread.variance(self.unread_s, stated.mean, stated.variance);
            let widest = variance.max(stated.variance);
            self.lost = Some(self.lost.map_or(widest, |lost| lost.max(widest)));
            return variance;
        };
        let surprising: T = number(SURPRISING_NIS);
        if nis > surprising {
            let jump = self.believed.map_or(T::zero(), |last| (rho - last) * number(self.parts.per_reading));
            let doubt = (T::one() - (surprising / nis).sqrt()) * jump;
            self.raise(doubt * doubt);
        } else {
            self.fading *= (-passed_s / number(DOUBT.fades_s)).exp();
            if let Some(lost) = self.lost.take() {
                self.raise(lost);
            }
            self.believed = Some(rho);
        }
        let (low, high): (T, T) = (number(self.parts.low), number(self.parts.high));
        let beyond = (rho - high).max(low - rho) - number::<T>(DOUBT.margin) * (high - low);
        self.outside = (self.outside * (-passed_s / number(DOUBT.outside_fades_s)).exp()).max(beyond);
        self.rest.iter_mut().for_each(|rest| {
            rest.see(passed_s, rho);
        });
        stated.variance
    }

    /// The strain's variance with all doubts, and flags that say so.
    pub fn widened(&self, rate: T, variance: T) -> (T, u32) {
        let far = number::<T>(DOUBT.shows) * self.outside.max(T::zero()) * number(self.parts.per_reading);
        let (outside, worth): (T, T) = (far * far, number(DOUBT.worth));
        let faster = rate.abs() / number(self.parts.fastest_per_s);
        let (is_fast, most): (bool, T) = (faster > number(DOUBT.faster), number(self.parts.most));
        let stated = if is_fast { (variance * (faster * faster)).min(most).max(variance) } else { variance };
        let rest_off = self.rest.map_or(T::zero(), |rest| rest.off());
        let elsewhere = rest_off * number(self.parts.per_reading);
        let more = (self.fading + outside + elsewhere * elsewhere).min(most);
        let raised = [
            (self.starts && self.fading > worth * number(self.parts.start), flag::START_UP),
            (!self.starts && self.fading > worth * variance, flag::RECOVERING),
            (outside > worth * variance || is_fast, flag::EXTRAPOLATED),
            (self.run_s > number(self.parts.longest_s), flag::LONG_RUN),
            (rest_off > T::zero(), flag::REST_MOVED),
        ];
        let flags = raised.into_iter().filter(|(is_raised, _)| *is_raised).fold(0, |flags, (_, flag)| flags | flag);
        (stated + more, flags)
    }
}
