use thiserror::Error;

/// A known strain: at a moment, or from one time to another while the body is held.
///
/// ```
/// use ohmstrain_calib::Mark;
///
/// let held = Mark { until_s: Some(30.0), strain_sd: Some(0.002), ..Mark::new(20.0, 0.15) };
/// assert_eq!(Mark::new(20.0, 0.15).until_s, None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Time, or the beginning of the hold, s.
    pub time_s: f64,
    /// End of the hold, s; if it is `None`, the readings determine whether the body was held, and for how long.
    pub until_s: Option<f64>,
    /// The strain.
    pub strain: f64,
    /// Its standard deviation; the default is 2 % of the span of all marks.
    pub strain_sd: Option<f64>,
    /// Standard deviation of its time, or of both ends of the hold, s; the default is 0.2 s, a person's reaction time.
    pub time_sd_s: Option<f64>,
}

impl Mark {
    /// Returns a strain at a moment.
    #[must_use]
    pub const fn new(time_s: f64, strain: f64) -> Self {
        Self { time_s, until_s: None, strain, strain_sd: None, time_sd_s: None }
    }

    /// Returns the last time of the mark, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.until_s.unwrap_or(self.time_s)
    }
}

/// Fault of marks that do not give a reference. Marks count from zero.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MarksError {
    /// Fewer than two marks.
    #[error("expected at least two marks of different strains, found {found}")]
    TooFew {
        /// Number of marks.
        found: usize,
    },
    /// All marks have the same strain.
    #[error("expected at least two different strains, found {strain} in every mark")]
    OneStrain {
        /// The strain.
        strain: f64,
    },
    /// A number that is NaN or infinite, or a standard deviation that is not positive.
    #[error("expected finite numbers and a positive standard deviation, found {found}")]
    Number {
        /// The mark.
        mark: usize,
        /// The number.
        found: f64,
    },
    /// A mark ends before it begins.
    #[error("expected an end after {time_s} s, found {until_s} s")]
    Reversed {
        /// The mark.
        mark: usize,
        /// Its beginning, s.
        time_s: f64,
        /// Its end, s.
        until_s: f64,
    },
    /// A mark begins before the previous one ends.
    #[error(
        "expected a time after {before_s} s, where the mark before it ends, found {time_s} s; a body has one strain at a time"
    )]
    Overlap {
        /// The later mark.
        mark: usize,
        /// Its beginning, s.
        time_s: f64,
        /// End of the previous mark, s.
        before_s: f64,
    },
    /// A mark lies outside of the recording.
    #[error("expected a time between {first_s} and {last_s} s, as the recording has, found {time_s} s")]
    Outside {
        /// The mark.
        mark: usize,
        /// Its time, s.
        time_s: f64,
        /// First time of the recording, s.
        first_s: f64,
        /// Last time of the recording, s.
        last_s: f64,
    },
}

impl MarksError {
    /// Returns the faulty mark; `None` if all marks together are at fault.
    #[must_use]
    pub const fn mark(&self) -> Option<usize> {
        match self {
            Self::TooFew { .. } | Self::OneStrain { .. } => None,
            Self::Number { mark, .. }
            | Self::Reversed { mark, .. }
            | Self::Overlap { mark, .. }
            | Self::Outside { mark, .. } => Some(*mark),
        }
    }
}

/// Checks that marks are in order, within the recording, and of at least two strains. Returns the smallest and the largest strain.
pub(crate) fn check(marks: &[Mark], time_s: &[f64]) -> Result<(f64, f64), MarksError> {
    let (first_s, last_s) = (time_s.first().copied().unwrap_or(f64::NAN), time_s.last().copied().unwrap_or(f64::NAN));
    let mut before_s = f64::NEG_INFINITY;
    for (k, mark) in marks.iter().enumerate() {
        let sds = [mark.strain_sd.unwrap_or(1.0), mark.time_sd_s.unwrap_or(1.0)];
        let numbers = [mark.time_s, mark.end_s(), mark.strain, sds[0], sds[1]];
        let is_wrong = |x: &&f64| !x.is_finite();
        if let Some(&found) = numbers.iter().find(is_wrong).or(sds.iter().find(|sd| **sd <= 0.0)) {
            return Err(MarksError::Number { mark: k, found });
        }
        if mark.end_s() < mark.time_s {
            return Err(MarksError::Reversed { mark: k, time_s: mark.time_s, until_s: mark.end_s() });
        }
        if mark.time_s <= before_s {
            return Err(MarksError::Overlap { mark: k, time_s: mark.time_s, before_s });
        }
        let is_outside = |time_s: &f64| !(first_s..=last_s).contains(time_s);
        if let Some(time_s) = [mark.time_s, mark.end_s()].into_iter().find(is_outside) {
            return Err(MarksError::Outside { mark: k, time_s, first_s, last_s });
        }
        before_s = mark.end_s();
    }
    let (low, high) = crate::order::extent(marks.iter().map(|mark| mark.strain));
    match marks {
        [] | [_] => Err(MarksError::TooFew { found: marks.len() }),
        _ if low == high => Err(MarksError::OneStrain { strain: low }),
        _ => Ok((low, high)),
    }
}
