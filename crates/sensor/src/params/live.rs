//! Constants of a filter in long-term use, from the calibration of its sensor.

use ohmstrain_ekf::live::{DOUBT, DoubtParts, RestBounds, RestSeen, SessionStart, Sieve, TurnSeen, Unread};

use crate::params::estimator::MotionParams;
use crate::params::repeating::Repeating;
use crate::params::{SensorParams, Sessions};

/// Factor by which a reading may lie outside the calibrated readings, and number of their ranges by which it may lie above
/// them. A new session, drift, or strains beyond the calibration do not double a resistance; a bad contact or a meter's
/// overload does. The step from one reading to the next has no limit. A filter that downweights outliers handles spikes as
/// well without one, and lasting changes better, which such a limit would have to accept after a while.
const OUTSIDE: f64 = 2.0;
/// Smallest jump of the readings, as a fraction of their calibrated range.
const JUMP: f64 = 0.08;
/// Repetition after which a reading counts as stuck, as a multiple of the longest repetition in calibration.
const LONGER: f64 = 3.0;

/// Relative tolerance of the rested sensor's reading around that in calibration: half of a noteworthy change, which is a
/// tenth.
const TOLERANCE: f64 = 0.05;
/// Time for which readings must stay constant to count as evidence about R₀, s: twice the duration of a doubt about a
/// start.
const LASTS_S: f64 = 10.0;
/// Share of the range of readings within which the reading at rest counts as one of its ends.
const AT_END: f64 = 0.25;

/// Additional standard deviation of the strain, in spans, at a filter's start. For starts in motion on six recordings, errors
/// in the first two seconds are 9 to 15 %FS where 7 to 11 is stated; after ten seconds they have almost settled.
const START: f64 = 0.1;

impl SensorParams {
    /// Converts a reading to `R/R₀ - 1`.
    fn relative(&self, reading: f64) -> f64 {
        reading / self.rest_reading - 1.0
    }

    /// Returns the smallest and largest `R/R₀ - 1` of the calibration.
    pub(crate) fn relative_readings(&self) -> (f64, f64) {
        (self.relative(self.validity.reading_lower), self.relative(self.validity.reading_upper))
    }

    /// Returns the plausibility check of readings, whose bounds lie far outside the calibrated readings.
    #[must_use]
    pub fn sieve(&self) -> Sieve<f64> {
        let seen = &self.validity;
        let (low, high) = (seen.reading_lower, seen.reading_upper);
        let beyond = OUTSIDE * (high - low);
        let repeating =
            seen.resolution.map_or(Repeating::UNKNOWN, |resolution| Repeating::new(resolution, self.rest_reading));
        Sieve {
            plausible: (self.relative(low / OUTSIDE), self.relative((high + beyond).max(high * OUTSIDE))),
            longest_repeat_s: if repeating.is_endless { f64::INFINITY } else { LONGER * seen.longest_repeat_s },
            most_repeats: repeating.most,
            fine_variance: repeating.fine_variance,
            jump: JUMP * (self.relative(high) - self.relative(low)),
            error_time_s: 0.0,
        }
    }

    /// Returns the reading at rest; `None` if no recording of the calibration begins at rest.
    #[must_use]
    pub fn rest_seen(&self) -> Option<RestSeen<f64>> {
        let rested = self.relative(self.measured_rest?);
        let (low, high) = self.relative_readings();
        let (sign, end) = match AT_END * (high - low) {
            near if rested - low <= near => (1.0, low.min(rested)),
            near if high - rested <= near => (-1.0, high.max(rested)),
            _ => (0.0, rested),
        };
        Some(RestSeen { rested, tolerance: TOLERANCE * (1.0 + rested), lasts_s: LASTS_S, sign, end })
    }

    /// Returns the bounds of readings that agree with the calibrated R₀. On the side of the largest strain the bound is the last
    /// reading of the calibration plus a margin. On the other side it is the reading at rest with its tolerance, if the
    /// calibration has one at the end of its readings; otherwise there is no bound, because a sensor that never rested in
    /// calibration may do so later.
    #[must_use]
    pub fn rest_bounds(&self) -> RestBounds<f64> {
        let seen = &self.validity;
        let (low, high) = self.relative_readings();
        let margin = DOUBT.margin * (high - low);
        let grows = self.static_cubic.strain(seen.reading_upper) > self.static_cubic.strain(seen.reading_lower);
        let sign = if grows { 1.0 } else { -1.0 };
        let rest = self.rest_seen().filter(|rest| rest.sign == sign);
        let near = rest.map(|rest| rest.end - sign * rest.tolerance);
        let start = self.session_start();
        if grows {
            RestBounds { low: near, high: Some(high + margin), start }
        } else {
            RestBounds { low: Some(low - margin), high: near, start }
        }
    }

    /// Returns the estimator of R₀ from the first reading of a session; `None` if the calibration has only one session, or none
    /// that begins at rest.
    fn session_start(&self) -> Option<SessionStart<f64>> {
        let (sessions, measured) = (self.sessions?, self.measured_rest?);
        Some(SessionStart { reading: self.relative(measured), weight: sessions.weight() })
    }

    /// Returns the variance of the strain due to the uncertainty of R₀ after a session's first reading, from the mean slope and at
    /// mid-range of the readings.
    fn session_variance(&self, per_reading: f64) -> f64 {
        let (low, high) = self.relative_readings();
        let of = |sessions: Sessions| (sessions.left_sd() * (1.0 + 0.5 * (low + high)) * per_reading).powi(2);
        self.sessions.map_or(0.0, of)
    }

    /// Returns the mean change of strain with the reading over R₀.
    pub(crate) fn strain_per_reading(&self) -> f64 {
        let (low, high) = self.relative_readings();
        if high > low { self.limits.span() / (high - low) } else { 0.0 }
    }

    /// Returns the variance of the strain that the effect of temperature leaves when it is removed.
    fn temperature_variance(&self, per_reading: f64) -> f64 {
        let readings = self.relative_readings();
        self.temperature.map_or(0.0, |temperature| per_reading.powi(2) * temperature.left_variance(readings))
    }

    /// Returns the turns of the readings; `None` for files of earlier versions.
    fn turns_seen(&self) -> Option<TurnSeen<f64>> {
        let turn = self.validity.turn() / self.rest_reading;
        self.validity.longest_unturned_s.map(|longest_s| TurnSeen { turn, longest_s })
    }

    /// Returns the doubts of a filter with this motion.
    #[must_use]
    pub fn filters_doubts(&self, motion: &MotionParams) -> DoubtParts<f64> {
        self.doubts(motion, self.unstated.filter_sd)
    }

    /// Returns the doubts of a smoother with this motion.
    #[must_use]
    pub fn smoothers_doubts(&self, motion: &MotionParams) -> DoubtParts<f64> {
        self.doubts(motion, self.unstated.smoother_sd)
    }

    fn doubts(&self, motion: &MotionParams, unstated_sd: f64) -> DoubtParts<f64> {
        let (seen, span) = (&self.validity, self.limits.span());
        let (low, high) = self.relative_readings();
        let unread = Unread::new(motion.rate_time_s, motion.rate_sd_per_s, self.limits);
        let per_reading = self.strain_per_reading();
        let unstated =
            self.session_variance(per_reading) + self.temperature_variance(per_reading) + unstated_sd.powi(2);
        DoubtParts {
            low,
            high,
            fastest_per_s: seen.fastest_rate_per_s,
            longest_s: if seen.drifts { seen.duration_s } else { f64::from(f32::MAX) },
            per_reading,
            start: (START * span).powi(2),
            most: unread.anywhere.max(unstated),
            unstated,
            unread,
            rest: self.rest_seen(),
            turns: self.turns_seen(),
        }
    }
}
