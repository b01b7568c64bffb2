//! Constants of a filter that runs for days, from the calibration of its sensor.

use ohmstrain_ekf::live::{DOUBT, DoubtParts, RestBounds, RestSeen, SessionStart, Sieve, TurnSeen, Unread};

use crate::params::estimator::MotionParams;
use crate::params::repeating::Repeating;
use crate::params::{SensorParams, Sessions};

/// Factor by which a reading may lie outside of the calibration's, and number of their ranges above them: another day, drift
/// and strains that were not calibrated for do not double a resistance; a bad contact or a meter's overload does. The step
/// from one reading to the next has no limit: a filter that downweights surprising readings does as well without one
/// against spikes, and better against lasting changes, which such a limit has to let in after a while.
const OUTSIDE: f64 = 2.0;
/// Share of calibration's range of readings by which they have jumped.
const JUMP: f64 = 0.08;
/// A number that has come again for so many times the longest repetition in calibration is stuck.
const LONGER: f64 = 3.0;

/// Relative tolerance of the rested sensor's reading around that in calibration: half of a change worth noticing, a tenth.
const TOLERANCE: f64 = 0.05;
/// Time for which readings must stay in place to count as evidence about R₀, s: twice as long as a doubt of a start lasts.
const LASTS_S: f64 = 10.0;
/// Share of the range of readings within which the reading at rest counts as one of its ends.
const AT_END: f64 = 0.25;

/// Standard deviation of the strain, in spans, that a filter has at its start besides what it states. Started in motion, on six
/// recordings, its errors of the first two seconds are 9 to 15 %FS where it states 7 to 11, and all but settled after ten.
const START: f64 = 0.1;

impl SensorParams {
    /// A reading as `R/R₀ - 1`.
    fn relative(&self, reading: f64) -> f64 {
        reading / self.rest_reading - 1.0
    }

    /// Least and largest `R/R₀ - 1` of the calibration.
    fn relative_readings(&self) -> (f64, f64) {
        (self.relative(self.validity.reading_lower), self.relative(self.validity.reading_upper))
    }

    /// Plausible readings: those that the calibration has seen, and far beyond them.
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

    /// Reading at rest; `None` where no recording of the calibration begins there.
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

    /// Between which readings R₀ is calibration's. On the side of the largest strain the last reading of the calibration, or a
    /// little more; on the other side that at rest, with what is left open to it, if the calibration has one and it is an end of
    /// its readings: a sensor that was never at rest then may get there.
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

    /// Estimate of R₀ from the first reading of a session; `None` for a calibration on one session, or on none that begins at rest.
    fn session_start(&self) -> Option<SessionStart<f64>> {
        let (sessions, measured) = (self.sessions?, self.measured_rest?);
        Some(SessionStart { reading: self.relative(measured), weight: sessions.weight() })
    }

    /// Variance of the strain from what a session's first reading leaves open of R₀, by the mean slope and at the mean of the readings.
    fn session_variance(&self, per_reading: f64) -> f64 {
        let (low, high) = self.relative_readings();
        let of = |sessions: Sessions| (sessions.left_sd() * (1.0 + 0.5 * (low + high)) * per_reading).powi(2);
        self.sessions.map_or(0.0, of)
    }

    /// Turns of the readings; `None` in files of earlier versions.
    fn turns_seen(&self) -> Option<TurnSeen<f64>> {
        let turn = self.validity.turn() / self.rest_reading;
        self.validity.longest_unturned_s.map(|longest_s| TurnSeen { turn, longest_s })
    }

    /// Doubts of a filter that runs with that motion.
    #[must_use]
    pub fn filters_doubts(&self, motion: &MotionParams) -> DoubtParts<f64> {
        self.doubts(motion, self.unstated.filter_sd)
    }

    /// Doubts of a smoother, likewise.
    #[must_use]
    pub fn smoothers_doubts(&self, motion: &MotionParams) -> DoubtParts<f64> {
        self.doubts(motion, self.unstated.smoother_sd)
    }

    fn doubts(&self, motion: &MotionParams, unstated_sd: f64) -> DoubtParts<f64> {
        let (seen, span) = (&self.validity, self.limits.span());
        let (low, high) = self.relative_readings();
        let unread = Unread::new(motion.rate_time_s, motion.rate_sd_per_s, self.limits.to_model());
        let per_reading = if high > low { span / (high - low) } else { 0.0 };
        let unstated = self.session_variance(per_reading) + unstated_sd.powi(2);
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
