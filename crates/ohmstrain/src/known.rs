use std::collections::VecDeque;

use ohmstrain_ekf::Gaussian;
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{KnownErrors, KnownStrain, MOST_KNOWN};

use crate::Error;
use crate::estimate::Scale;

/// Default standard deviation of a known strain, in spans of the limits.
const KNOWN_TO: f64 = 0.005;

/// A strain (or angle) that is known at a time: a stop, a mark on the bench, a joint that is seen.
///
/// ```
/// use ohmstrain::Known;
///
/// let known = Known { sd: Some(0.002), ..Known::new(12.5, 0.10) };
/// assert_eq!((known.time_s, known.strain), (12.5, 0.10));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Time, s: it is the strain of the first row from then on.
    pub time_s: f64,
    /// The strain, or the angle in degrees.
    pub strain: f64,
    /// Its standard deviation; without it 0.5 % of the sensor's limits.
    pub sd: Option<f64>,
}

impl Known {
    /// Known to 0.5 % of the sensor's limits.
    ///
    /// ```
    /// assert_eq!(ohmstrain::Known::new(3.0, 0.0).sd, None);
    /// ```
    #[must_use]
    pub const fn new(time_s: f64, strain: f64) -> Self {
        Self { time_s, strain, sd: None }
    }

    pub(crate) fn checked(self, scale: &Scale) -> Result<(f64, Gaussian<f64>), Error> {
        let sd = self.sd.unwrap_or_else(|| KNOWN_TO * scale.span());
        Ok((self.time_s, scale.known(self.strain, sd)?))
    }
}

/// Checked strains in order of time.
pub(crate) fn in_order(known: &[Known], scale: &Scale) -> Result<VecDeque<(f64, Gaussian<f64>)>, Error> {
    let mut known = known.iter().map(|known| known.checked(scale)).collect::<Result<Vec<_>, _>>()?;
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(known.into())
}

/// The next of them that is known by `time_s`.
pub(crate) fn next_until(known: &mut VecDeque<(f64, Gaussian<f64>)>, time_s: f64) -> Option<Gaussian<f64>> {
    known.front().is_some_and(|known| known.0 <= time_s).then(|| known.pop_front()).flatten().map(|known| known.1)
}

/// Errors at the known strains of a recording, applied to all its rows: each row uses the nearest ones on both sides.
pub(crate) struct KnownOfAll {
    limits: StrainRange<f64>,
    strains: Vec<KnownStrain>,
    /// Number of strains known by the row that was asked for last, and the errors at those around it.
    around: Option<(usize, KnownErrors)>,
}

impl KnownOfAll {
    /// Strains in order of time.
    pub(crate) const fn new(limits: StrainRange<f64>, strains: Vec<KnownStrain>) -> Self {
        Self { limits, strains, around: None }
    }

    /// A statement without what is known of its error.
    pub(crate) fn correct(&mut self, time_s: f64, estimated: Gaussian<f64>) -> Gaussian<f64> {
        let before = self.strains.partition_point(|strain| strain.time_s <= time_s);
        let is_new = self.around.as_ref().is_none_or(|around| around.0 != before);
        if is_new {
            let first = before.saturating_sub(MOST_KNOWN / 2);
            let last = self.strains.len().min(before + MOST_KNOWN / 2);
            self.around = Some((before, KnownErrors::of(self.limits, &self.strains[first..last])));
        }
        self.around.as_ref().map_or(estimated, |(_, errors)| errors.correct(time_s, estimated))
    }
}
