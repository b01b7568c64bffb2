//! What a reading must be, and when an interval is wider than the filter says.

use ohmstrain_ekf::live::{DOUBT, DoubtParts, FOLLOWING, Innovations, MOST_REPEATS, NEVER_READ_S, RestBounds, Sieve};
use serde::Serialize;

use crate::export::literal::Literal;

/// What a reading must be.
#[derive(Debug, Serialize)]
pub struct SieveConstants {
    lower: Literal,
    upper: Literal,
    longest_repeat_s: Option<Literal>,
    most_repeats: u32,
    jump: Literal,
    error_time_s: Option<Literal>,
}

/// When the interval is wider than the filter says.
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
    far_fades_s: Literal,
    near_counts: Literal,
    far_counts: Literal,
    /// 1 where readings grow from rest on, -1 where they fall, 0 where it is not known.
    sign: Literal,
    most_nis: Literal,
    margin: Literal,
    faster: Literal,
    worth: Literal,
    zero: Literal,
    unread: UnreadConstants,
    rest: Option<RestConstants>,
}

/// How R₀ follows the readings.
#[derive(Debug, Serialize)]
pub struct FollowConstants {
    low: Option<Literal>,
    of_low: Option<Literal>,
    high: Option<Literal>,
    of_high: Option<Literal>,
    leaves_s: Literal,
    returns_s: Literal,
    longest_s: Literal,
    fault_s: Literal,
    least: Literal,
    most: Literal,
}

/// What is known without a reading.
#[derive(Debug, Serialize)]
struct UnreadConstants {
    rate_time_s: Literal,
    path_variance: Literal,
    centre: Literal,
    anywhere: Literal,
    never_s: Literal,
}

/// Where the sensor rests.
#[derive(Debug, Serialize)]
struct RestConstants {
    rested: Literal,
    tolerance: Literal,
    lasts_s: Literal,
    end: Literal,
}

impl DoubtConstants {
    /// Of a sensor; a strain below `zero` is none.
    pub fn new(seen: &DoubtParts<f64>, zero: Literal) -> Self {
        let narrow = |number: f64| Literal(number as f32);
        Self {
            low: narrow(seen.low),
            high: narrow(seen.high),
            fastest_per_s: narrow(seen.fastest_per_s),
            longest_s: narrow(seen.longest_s),
            per_reading: narrow(seen.per_reading),
            start: narrow(seen.start),
            most: narrow(seen.most),
            far_fades_s: narrow(DOUBT.far_fades_s),
            near_counts: narrow(DOUBT.near_counts),
            far_counts: narrow(DOUBT.far_counts),
            sign: narrow(seen.rest.map_or(0.0, |rest| rest.sign)),
            most_nis: narrow(Innovations::<f64>::MOST),
            margin: narrow(DOUBT.margin),
            faster: narrow(DOUBT.faster),
            worth: narrow(DOUBT.worth),
            zero,
            unread: UnreadConstants {
                rate_time_s: narrow(seen.unread.rate_time_s),
                path_variance: narrow(seen.unread.path_variance),
                centre: narrow(seen.unread.centre),
                anywhere: narrow(seen.unread.anywhere),
                never_s: narrow(NEVER_READ_S),
            },
            rest: seen.rest.map(|rest| RestConstants {
                rested: narrow(rest.rested),
                tolerance: narrow(rest.tolerance),
                lasts_s: narrow(rest.lasts_s),
                end: narrow(rest.end),
            }),
        }
    }
}

impl FollowConstants {
    /// Of a sensor.
    pub fn new(bounds: RestBounds<f64>) -> Self {
        let narrow = |number: f64| Literal(number as f32);
        let rest = |bound: f64| Literal(1.0 + bound as f32);
        Self {
            low: bounds.low.map(narrow),
            of_low: bounds.low.map(rest),
            high: bounds.high.map(narrow),
            of_high: bounds.high.map(rest),
            leaves_s: narrow(FOLLOWING.leaves_s),
            returns_s: narrow(FOLLOWING.returns_s),
            longest_s: narrow(FOLLOWING.longest_s),
            fault_s: narrow(FOLLOWING.fault_s),
            least: narrow(1.0 / FOLLOWING.farthest - 1.0),
            most: narrow(FOLLOWING.farthest - 1.0),
        }
    }
}

impl SieveConstants {
    /// Of a filter.
    pub fn new(sieve: &Sieve<f64>) -> Self {
        let finite = |number: f32| number.is_finite().then_some(Literal(number));
        Self {
            lower: Literal(sieve.plausible.0 as f32),
            upper: Literal(sieve.plausible.1 as f32),
            longest_repeat_s: finite(sieve.longest_repeat_s as f32),
            most_repeats: MOST_REPEATS,
            jump: Literal(sieve.jump as f32),
            error_time_s: Some(Literal(sieve.error_time_s as f32)).filter(|time_s| time_s.0 > 0.0),
        }
    }
}
