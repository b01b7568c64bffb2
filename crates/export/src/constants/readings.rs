//! Limits of plausible readings, and constants of the widening of intervals.

use ohmstrain_ekf::live::{DoubtParts, RestBounds, Sieve};
use ohmstrain_sensor::TemperatureParams;
use serde::Serialize;

use crate::literal::Literal;

/// Limits of plausible readings.
#[derive(Debug, Serialize)]
pub struct SieveConstants {
    lower: Literal,
    upper: Literal,
    longest_repeat_s: Option<Literal>,
    most_repeats: Literal,
    fine_variance: Literal,
    jump: Literal,
    error_time_s: Option<Literal>,
}

/// Constants of the doubts, which widen the filter's own interval.
#[derive(Debug, Serialize)]
pub struct DoubtConstants {
    low: Literal,
    high: Literal,
    fastest_per_s: Literal,
    longest_s: Literal,
    per_reading: Literal,
    /// Variances.
    start: Literal,
    most: Literal,
    /// Variance of strain errors that the filter does not state.
    unstated: Literal,
    /// 1 if readings grow from rest on, -1 if they fall, 0 if unknown.
    sign: Literal,
    zero: Literal,
    unread: UnreadConstants,
    rest: Option<RestConstants>,
    turns: Option<TurnConstants>,
}

/// Range of readings within which R₀ remains the calibration's.
#[derive(Debug, Serialize)]
pub struct FollowConstants {
    low: Option<Literal>,
    high: Option<Literal>,
    /// The usual first reading of a session, and its weight.
    start: Option<[Literal; 2]>,
}

/// Effect of temperature on the readings, per kelvin, and the calibration's temperatures, °C.
#[derive(Debug, Serialize)]
pub struct TemperatureConstants {
    reference_c: Literal,
    lower_c: Literal,
    upper_c: Literal,
    rest_per_k: Literal,
    gain_per_k: Literal,
    least_factor: Literal,
}

impl TemperatureConstants {
    /// Converts the constants of a sensor.
    pub fn new(effect: TemperatureParams) -> Self {
        Self {
            reference_c: Literal(effect.reference_c as f32),
            lower_c: Literal(effect.lower_c as f32),
            upper_c: Literal(effect.upper_c as f32),
            rest_per_k: Literal(effect.rest_per_k as f32),
            gain_per_k: Literal(effect.gain_per_k as f32),
            least_factor: Literal(TemperatureParams::LEAST_FACTOR as f32),
        }
    }
}

/// Constants for rows without a reading.
#[derive(Debug, Serialize)]
struct UnreadConstants {
    rate_time_s: Literal,
    path_variance: Literal,
    centre: Literal,
    anywhere: Literal,
}

/// Constants for the sensor at rest.
#[derive(Debug, Serialize)]
struct RestConstants {
    rested: Literal,
    tolerance: Literal,
    lasts_s: Literal,
    end: Literal,
}

/// Constants for turning points of readings.
#[derive(Debug, Serialize)]
struct TurnConstants {
    turn: Literal,
    longest_s: Literal,
}

impl DoubtConstants {
    /// Converts the constants of a sensor; a strain below `zero` counts as zero.
    pub fn new(seen: &DoubtParts<f32>, zero: Literal) -> Self {
        Self {
            low: Literal(seen.low),
            high: Literal(seen.high),
            fastest_per_s: Literal(seen.fastest_per_s),
            longest_s: Literal(seen.longest_s),
            per_reading: Literal(seen.per_reading),
            start: Literal(seen.start),
            most: Literal(seen.most),
            unstated: Literal(seen.unstated),
            sign: Literal(seen.rest.map_or(0.0, |rest| rest.sign)),
            zero,
            unread: UnreadConstants {
                rate_time_s: Literal(seen.unread.rate_time_s),
                path_variance: Literal(seen.unread.path_variance),
                centre: Literal(seen.unread.centre),
                anywhere: Literal(seen.unread.anywhere),
            },
            rest: seen.rest.map(|rest| RestConstants {
                rested: Literal(rest.rested),
                tolerance: Literal(rest.tolerance),
                lasts_s: Literal(rest.lasts_s),
                end: Literal(rest.end),
            }),
            turns: seen
                .turns
                .map(|turns| TurnConstants { turn: Literal(turns.turn), longest_s: Literal(turns.longest_s) }),
        }
    }
}

impl FollowConstants {
    /// Converts the constants of a sensor.
    pub fn new(bounds: RestBounds<f32>) -> Self {
        let start = bounds.start.map(|start| [Literal(start.reading), Literal(start.weight)]);
        Self { low: bounds.low.map(Literal), high: bounds.high.map(Literal), start }
    }
}

impl SieveConstants {
    /// Converts the constants of a filter.
    pub fn new(sieve: &Sieve<f32>) -> Self {
        let finite = |number: f32| number.is_finite().then_some(Literal(number));
        Self {
            lower: Literal(sieve.plausible.0),
            upper: Literal(sieve.plausible.1),
            longest_repeat_s: finite(sieve.longest_repeat_s),
            most_repeats: Literal(sieve.most_repeats),
            fine_variance: Literal(sieve.fine_variance),
            jump: Literal(sieve.jump),
            error_time_s: Some(Literal(sieve.error_time_s)).filter(|time_s| time_s.0 > 0.0),
        }
    }
}
