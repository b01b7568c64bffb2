use std::collections::VecDeque;

use ohmstrain_ekf::Gaussian;
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{KnownErrors, KnownStrain, MOST_KNOWN, Stated};

use crate::Error;
use crate::estimate::Scale;

/// Default standard deviation of a known strain, as a share of the limits' span.
pub(crate) const KNOWN_TO: f64 = 0.005;

/// A strain (or angle) known at a certain time: at an end stop, a mark on the bench, or a joint in view.
///
/// ```
/// use ohmstrain::Known;
///
/// let known = Known { sd: Some(0.002), ..Known::new(12.5, 0.10) };
/// assert_eq!((known.time_s, known.strain), (12.5, 0.10));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Time, s. It applies to the first row at or after this time.
    pub time_s: f64,
    /// The strain, or the angle in degrees.
    pub strain: f64,
    /// Its standard deviation; the default is 0.5 % of the limits' span.
    pub sd: Option<f64>,
}

impl Known {
    /// Creates a known strain with the default standard deviation.
    ///
    /// ```
    /// assert_eq!(ohmstrain::Known::new(3.0, 0.0).sd, None);
    /// ```
    #[must_use]
    pub const fn new(time_s: f64, strain: f64) -> Self {
        Self { time_s, strain, sd: None }
    }

    pub(crate) fn checked(self, scale: &Scale) -> Result<(f64, Gaussian<f64>), Error> {
        let sd = self.sd.unwrap_or_else(|| KNOWN_TO * scale.limits.span());
        Ok((self.time_s, scale.known(self.strain, sd)?))
    }
}

/// Checks known strains, and returns them in order of time.
pub(crate) fn in_order(known: &[Known], scale: &Scale) -> Result<VecDeque<(f64, Gaussian<f64>)>, Error> {
    let mut known = known.iter().map(|known| known.checked(scale)).collect::<Result<Vec<_>, _>>()?;
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(known.into())
}

/// Removes and returns the next strain that is known by `time_s`.
pub(crate) fn next_until(known: &mut VecDeque<(f64, Gaussian<f64>)>, time_s: f64) -> Option<Gaussian<f64>> {
    known.front().is_some_and(|known| known.0 <= time_s).then(|| known.pop_front()).flatten().map(|known| known.1)
}

/// Errors at the known strains of a recording, applied to all its rows: each row uses the nearest ones on both sides.
pub(crate) struct KnownOfAll {
    limits: StrainRange<f64>,
    strains: Vec<KnownStrain>,
    /// Number of strains known by the row requested last, and the errors at those around it.
    around: Option<(usize, KnownErrors)>,
}

impl KnownOfAll {
    /// Creates it from strains in order of time.
    pub(crate) const fn new(limits: StrainRange<f64>, strains: Vec<KnownStrain>) -> Self {
        Self { limits, strains, around: None }
    }

    /// Corrects an estimate by the errors at known strains.
    pub(crate) fn correct(&mut self, time_s: f64, estimated: Stated) -> Gaussian<f64> {
        let before = self.strains.partition_point(|strain| strain.time_s <= time_s);
        let is_new = self.around.as_ref().is_none_or(|around| around.0 != before);
        if is_new {
            let first = before.saturating_sub(MOST_KNOWN / 2);
            let last = self.strains.len().min(before + MOST_KNOWN / 2);
            self.around = Some((before, KnownErrors::of(self.limits, &self.strains[first..last])));
        }
        self.around.as_ref().map_or(estimated.widened(), |(_, errors)| errors.correct(time_s, estimated))
    }
}
