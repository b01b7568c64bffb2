use ohmstrain_calib::{Output, SURPRISING_NIS, SensorParams};
use ohmstrain_ekf::ReadingVerdict;

use crate::pauses::Pauses;
use crate::rest_watch::ZERO;
use crate::{Flag, Flags, NEVER_READ_S, RestSeen, RestWatch, Unread};

/// What no filter knows by itself: that it has only just begun, or begun again; that readings have jumped; that the sensor is
/// used outside of what its calibration has seen. It widens the strain's interval, and says why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt {
    seen: Seen,
    start_s: Option<f64>,
    last_s: f64,
    /// Variance of the strain that fades while readings are believed.
    fading: f64,
    starting: bool,
    /// What is known without a reading, and for how long there has been none, s.
    unread: Unread,
    unread_s: f64,
    /// The strain's variance where readings have not been believed since.
    lost: Option<f64>,
    /// The last reading that was believed, R/R₀ - 1.
    believed: Option<f64>,
    /// How far readings have been outside of calibration's, R/R₀ - 1, fading.
    outside: f64,
    /// Whether R₀ is calibration's; none where that one does not know what the sensor reads at rest.
    rest: Option<RestWatch<f64>>,
}

/// What calibration has seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Range of R/R₀ - 1.
    low: f64,
    high: f64,
    fastest_per_s: f64,
    longest_s: f64,
    /// Range of the strain, and that over the range of R/R₀ - 1.
    span: f64,
    per_reading: f64,
}

/// Standard deviation of the strain, in spans, that a filter has at its start besides what it states. Started in motion, on six
/// recordings, its errors of the first two seconds are 9 to 15 %FS where it states 7 to 11, and all but settled after ten.
const START: f64 = 0.1;
/// How long it takes until a doubt has fallen to 37 %, s: that a filter has just begun, or begun again; that readings were outside.
const FADES_S: f64 = 5.0;
const OUTSIDE_FADES_S: f64 = 60.0;
/// Readings may lie outside of calibration's by this share of their range for nothing; what they are beyond that counts twice, as
/// where all readings are off only those at an end of their range show it, and not all of it.
const MARGIN: f64 = 0.02;
const SHOWS: f64 = 2.0;
/// How many times the fastest rate of calibration, which is its 99th percentile, is beyond it.
const FASTER: f64 = 1.5;
/// What is known of the strain least of all, in spans: as deviation.
const MOST: f64 = 0.5;
/// Share of the filter's variance, or of the doubt at a start, from which on a doubt is worth a flag.
const WORTH: f64 = 0.2;

/// The numbers behind the widened intervals, for programs that write a filter in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtNumbers {
    /// Deviation at an unknown start, and what is known least of all, in spans of the strain.
    pub start: f64,
    /// As deviation, in spans.
    pub most: f64,
    /// Times after which doubts have fallen to 37 %, s: of a start or a fault, and of readings outside of calibration's.
    pub fades_s: f64,
    /// See [`Self::fades_s`].
    pub outside_fades_s: f64,
    /// Share of calibration's range of readings that counts for nothing, and how many times counts what is beyond.
    pub margin: f64,
    /// See [`Self::margin`].
    pub shows: f64,
    /// How many times calibration's fastest rate is beyond it.
    pub faster: f64,
    /// Share of a variance from which on a doubt is worth a flag.
    pub worth: f64,
    /// Share of the span that a strain of none may have.
    pub zero: f64,
}

/// The numbers behind the widened intervals.
pub const DOUBT: DoubtNumbers = DoubtNumbers {
    start: START,
    most: MOST,
    fades_s: FADES_S,
    outside_fades_s: OUTSIDE_FADES_S,
    margin: MARGIN,
    shows: SHOWS,
    faster: FASTER,
    worth: WORTH,
    zero: ZERO,
};

impl Doubt {
    /// Before the first row, with its strain if that is known.
    pub(crate) fn new(params: &SensorParams, unread: Unread, known: Option<f64>) -> Self {
        let starts_known = known.is_some();
        let (seen, span) = (&params.validity, params.limits.span());
        let relative = |reading: f64| reading / params.rest_reading - 1.0;
        let (low, high) = (relative(seen.reading_lower), relative(seen.reading_upper));
        let start = if starts_known { 0.0 } else { START * span };
        Self {
            seen: Seen {
                low,
                high,
                fastest_per_s: seen.fastest_rate_per_s,
                longest_s: seen.duration_s,
                span,
                per_reading: if high > low { span / (high - low) } else { 0.0 },
            },
            start_s: None,
            last_s: 0.0,
            fading: start * start,
            starting: !starts_known,
            unread,
            unread_s: if starts_known { 0.0 } else { NEVER_READ_S },
            lost: None,
            believed: None,
            outside: 0.0,
            rest: RestSeen::of(params).map(|seen| RestWatch::new(seen, known.is_some_and(|x| x.abs() <= ZERO * span))),
        }
    }

    /// R₀ of today has been told.
    pub(crate) fn told_rest(&mut self) {
        self.rest.iter_mut().for_each(RestWatch::told);
    }

    /// The strain is known now: what was doubted of it is gone.
    pub(crate) fn settle(&mut self) {
        (self.fading, self.starting, self.lost, self.unread_s) = (0.0, false, None, 0.0);
    }

    /// There is more to doubt than what is left of a start.
    fn raise(&mut self, variance: f64) {
        if variance > self.fading {
            (self.fading, self.starting) = (variance, false);
        }
    }

    /// Takes a row, with the reading R/R₀ - 1 if there is one; widens the interval of its strain and says why.
    pub(crate) fn widen(&mut self, time_s: f64, reading: Option<f64>, output: &mut Output) -> Flags {
        let start_s = *self.start_s.get_or_insert(time_s);
        let dt_s = if start_s < time_s { time_s - self.last_s } else { 0.0 };
        self.last_s = time_s;
        let taken = reading.filter(|_| is_taken(output.verdict));
        let filtered = output.estimate.strain;
        self.unread_s = if taken.is_some() { 0.0 } else { self.unread_s + dt_s };
        let variance = match taken {
            Some(_) => filtered.variance,
            None => self.unread.variance(self.unread_s, filtered.mean, filtered.variance),
        };
        // The share of an innovation that is beyond what is no surprise.
        let surprise = output.nis.map_or(0.0, |nis| 1.0 - (SURPRISING_NIS / nis).sqrt());
        let most = (MOST * self.seen.span).powi(2);
        match taken {
            None => self.lost = Some(self.lost.unwrap_or(0.0).max(variance).max(filtered.variance)),
            Some(reading) if surprise > 0.0 => {
                let jump = self.believed.map_or(0.0, |last| (reading - last) * self.seen.per_reading);
                self.raise((surprise * jump).powi(2).min(most));
            }
            Some(reading) => {
                self.fading *= (-dt_s / FADES_S).exp();
                if let Some(lost) = self.lost.take() {
                    self.raise((lost).min(most));
                }
                self.believed = Some(reading);
            }
        }
        if let Some(reading) = taken {
            let range = self.seen.high - self.seen.low;
            let beyond = (reading - self.seen.high).max(self.seen.low - reading) - MARGIN * range;
            self.outside = (self.outside * (-dt_s / OUTSIDE_FADES_S).exp()).max(beyond);
            self.rest.iter_mut().for_each(|rest| {
                rest.see(dt_s, reading);
            });
        }
        let rest_off = self.rest.map_or(0.0, |rest| rest.off());
        let elsewhere = (rest_off * self.seen.per_reading).powi(2);
        let outside = (SHOWS * self.outside.max(0.0) * self.seen.per_reading).powi(2);
        let faster = (output.estimate.rate.mean / self.seen.fastest_per_s).abs();
        let is_fast = faster > FASTER;
        let stated = if is_fast { (variance * (faster * faster)).min(most).max(variance) } else { variance };
        output.estimate.strain.variance = stated + (self.fading + outside + elsewhere).min(most);
        let starts = self.starting && self.fading > WORTH * (START * self.seen.span).powi(2);
        let recovers = !self.starting && self.fading > WORTH * variance;
        Flags::NONE
            .with(Flag::StartUp, starts)
            .with(Flag::Recovering, recovers)
            .with(Flag::Extrapolated, outside > WORTH * variance || is_fast)
            .with(Flag::RestMoved, rest_off > 0.0)
            .and(self.long_run(time_s - start_s))
    }

    /// The same pauses for a smoother.
    pub(crate) const fn pauses(&self) -> Pauses {
        Pauses::new(self.unread, self.unread_s)
    }

    /// What there is to say of a row so long after the first one, s.
    pub(crate) fn long_run(&self, since_start_s: f64) -> Flags {
        Flags::NONE.with(Flag::LongRun, since_start_s > self.seen.longest_s)
    }
}

/// Whether a reading has told the filter something.
pub(crate) const fn is_taken(verdict: ReadingVerdict) -> bool {
    matches!(verdict, ReadingVerdict::Accepted | ReadingVerdict::Downweighted | ReadingVerdict::Readmitted)
}
