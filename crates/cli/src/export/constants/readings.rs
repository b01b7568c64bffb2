//! What a reading must be, and when an interval is wider than the filter says.

use ohmstrain_ekf::live::{DoubtParts, RestBounds, Sieve};
use serde::Serialize;

use crate::export::literal::Literal;

/// What a reading must be.
#[derive(Debug, Serialize)]
pub struct SieveConstants {
    lower: Literal,
    upper: Literal,
    longest_repeat_s: Option<Literal>,
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
    /// 1 where readings grow from rest on, -1 where they fall, 0 where it is not known.
    sign: Literal,
    zero: Literal,
    unread: UnreadConstants,
    rest: Option<RestConstants>,
}

/// Between which readings R₀ is calibration's.
#[derive(Debug, Serialize)]
pub struct FollowConstants {
    low: Option<Literal>,
    high: Option<Literal>,
}

/// What is known without a reading.
#[derive(Debug, Serialize)]
struct UnreadConstants {
    rate_time_s: Literal,
    path_variance: Literal,
    centre: Literal,
    anywhere: Literal,
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
            sign: narrow(seen.rest.map_or(0.0, |rest| rest.sign)),
            zero,
            unread: UnreadConstants {
                rate_time_s: narrow(seen.unread.rate_time_s),
                path_variance: narrow(seen.unread.path_variance),
                centre: narrow(seen.unread.centre),
                anywhere: narrow(seen.unread.anywhere),
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
        Self { low: bounds.low.map(narrow), high: bounds.high.map(narrow) }
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
            jump: Literal(sieve.jump as f32),
            error_time_s: Some(Literal(sieve.error_time_s as f32)).filter(|time_s| time_s.0 > 0.0),
        }
    }
}
