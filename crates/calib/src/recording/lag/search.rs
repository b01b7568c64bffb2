use super::motion::{BLOCKS, Fit, Pull, ReferenceRegressors};
use super::{Lag, LagError};

/// Number of lags tried in the time of one full stretch, in the coarse search.
const COARSE_STEPS: f64 = 12.0;
/// Number of lags tried between two of those, around the best.
const FINE_STEPS: i32 = 8;
/// Least fraction of the shorter recording that must overlap with the longer one.
const LEAST_OVERLAP: f64 = 0.4;
/// Least number of strokes over the whole range in the overlap, on one clock; one or two can be explained anywhere.
const LEAST_STROKES: f64 = 4.0;
/// Window of the high-pass, in full stretches.
const SLOW: f64 = 2.0;
/// Other windows, which show the effect of that choice.
const OTHER_SLOW: [f64; 2] = [1.0, 4.0];
/// Largest unexplained fraction of the readings' variance at which the motion shows in them.
const MOST_UNEXPLAINED: f64 = 0.6;
/// Ratio of errors below which another lag fits as well as the best one.
const ALIKE: f64 = 3.0;
/// Least overlap of such a lag, as a fraction of the best one's rows; with fewer rows it is no evidence against the
/// best one.
const ALIKE_OVERLAP: f64 = 0.6;
/// Unexplained fraction below which fits count as equal, due to rounding and noise.
const EXPLAINED: f64 = 3e-4;

/// Fits at all lags tried.
pub(super) struct Search {
    motion: ReferenceRegressors,
    pull: Pull,
    /// Lags, s, increasing.
    lags: Vec<f64>,
    fits: Vec<Option<Fit>>,
    coarse_s: f64,
}

impl Search {
    pub(super) fn new(
        readings: (&[f64], &[f64]),
        reference: (&[f64], &[f64]),
        within_s: Option<f64>,
    ) -> Result<Self, LagError> {
        let motion = ReferenceRegressors::new(reference, SLOW).ok_or(LagError::Short)?;
        let pull = Pull::new(readings, &motion).ok_or(LagError::Short)?;
        let coarse_s =
            within_s.map_or(f64::INFINITY, |within| within / COARSE_STEPS).min(motion.stretch_s / COARSE_STEPS);
        let (first, last) = range(&motion, &pull, within_s).ok_or(LagError::Short)?;
        // Zero is one of the lags.
        let lags: Vec<f64> = ((first / coarse_s).ceil() as i64..=(last / coarse_s).floor() as i64)
            .map(|step| step as f64 * coarse_s)
            .collect();
        let fits = lags.iter().map(|lag_s| pull.fit(&motion, *lag_s)).collect();
        Ok(Self { motion, pull, lags, fits, coarse_s })
    }

    /// Returns the lag with the least logarithm of the unexplained fraction, over the rows for which it leaves a
    /// reference.
    pub(super) fn best(&self) -> Result<usize, LagError> {
        let known = (0..self.lags.len()).filter(|&i| self.fits[i].is_some());
        let best = known.min_by(|a, b| self.cost(*a).total_cmp(&self.cost(*b))).ok_or(LagError::Short)?;
        let unexplained = self.error(best);
        if unexplained > MOST_UNEXPLAINED {
            return Err(LagError::Unseen(unexplained));
        }
        Ok(best)
    }

    /// Returns a lag, s, if it is at an end of those tried.
    pub(super) fn end(&self, i: usize) -> Option<f64> {
        (i == 0 || i + 1 == self.lags.len()).then(|| self.lags[i])
    }

    /// Returns the index of the lag zero.
    pub(super) fn zero(&self) -> usize {
        self.lags.partition_point(|lag_s| *lag_s < -0.5 * self.coarse_s).min(self.lags.len().saturating_sub(1))
    }

    /// Returns a lag within `share` of a movement that fits as well as the best one.
    pub(super) fn nearest_to_zero(&self, best: usize, share: f64) -> Option<usize> {
        let alike = self.alike(best).filter(|&i| self.lags[i].abs() <= share * self.motion.stretch_s);
        alike.min_by(|a, b| self.error(*a).total_cmp(&self.error(*b)))
    }

    /// Refuses a lag if another one, more than half a stretch away, fits as well.
    pub(super) fn check(&self, best: usize) -> Result<(), LagError> {
        let apart = |i: &usize| (self.lags[*i] - self.lags[best]).abs() > 0.5 * self.motion.stretch_s;
        let rival = self.alike(best).filter(apart).min_by(|a, b| self.cost(*a).total_cmp(&self.cost(*b)));
        rival.map_or(Ok(()), |rival| Err(LagError::Repeats(self.lags[best], self.lags[rival])))
    }

    /// Returns the error without a lag over that with it.
    pub(super) fn gain(&self, i: usize) -> f64 {
        self.pull.fit(&self.motion, 0.0).map_or(1.0, |fit| fit.unexplained).max(EXPLAINED) / self.error(i)
    }

    /// Refines a lag near one that was tried.
    pub(super) fn lag(
        &self,
        i: usize,
        readings: (&[f64], &[f64]),
        reference: (&[f64], &[f64]),
    ) -> Result<Lag, LagError> {
        let (lag_s, sd_s, unexplained) = refine(&self.motion, &self.pull, self.lags[i], self.coarse_s);
        let mut squares = sd_s * sd_s;
        for slow in OTHER_SLOW {
            let motion = ReferenceRegressors::new(reference, slow).ok_or(LagError::Short)?;
            let Some(pull) = Pull::new(readings, &motion) else { continue };
            let (other_s, ..) = refine(&motion, &pull, lag_s, self.coarse_s);
            squares += (other_s - lag_s).powi(2) / OTHER_SLOW.len() as f64;
        }
        Ok(super::of_motion(lag_s, squares.sqrt(), self.motion.stretch_s, self.gain(i), unexplained))
    }

    /// Returns the local minima that fit as well as the best lag, which is among them.
    fn alike(&self, best: usize) -> impl Iterator<Item = usize> {
        let overlap = |i: usize| self.fits[i].as_ref().map_or(0.0, |fit| fit.overlap);
        let is_valley = |i: usize| {
            i > 0 && i + 1 < self.lags.len() && self.cost(i) <= self.cost(i - 1) && self.cost(i) <= self.cost(i + 1)
        };
        (0..self.lags.len()).filter(move |&i| {
            i == best
                || is_valley(i)
                    && self.error(i) < ALIKE * self.error(best)
                    && overlap(i) > ALIKE_OVERLAP * overlap(best)
        })
    }

    fn error(&self, i: usize) -> f64 {
        self.fits[i].as_ref().map_or(f64::INFINITY, |fit| fit.unexplained.max(EXPLAINED))
    }

    fn cost(&self, i: usize) -> f64 {
        self.fits[i].as_ref().map_or(f64::INFINITY, |fit| fit.overlap * self.error(i).min(1.0).ln())
    }
}

/// Returns the range of lags to try, s.
fn range(motion: &ReferenceRegressors, pull: &Pull, within_s: Option<f64>) -> Option<(f64, f64)> {
    let ((r0, r1), (s0, s1)) = (pull.span(), motion.span());
    let common = LEAST_OVERLAP * (r1 - r0).min(s1 - s0);
    let (first, last) = (s0 - (r1 - common), s1 - (r0 + common));
    let Some(within_s) = within_s else { return Some((first, last)) };
    let (earliest_s, latest_s) = motion.lags_with_strokes(LEAST_STROKES)?;
    Some((first.max(-within_s).max(earliest_s), last.min(within_s).min(latest_s)))
}

/// Returns the minimum near a lag, its jackknife standard deviation over blocks, and its unexplained fraction.
fn refine(motion: &ReferenceRegressors, pull: &Pull, about_s: f64, coarse_s: f64) -> (f64, f64, f64) {
    let step_s = coarse_s / f64::from(FINE_STEPS);
    let lags: Vec<f64> = (-2 * FINE_STEPS..=2 * FINE_STEPS).map(|i| about_s + f64::from(i) * step_s).collect();
    let fits: Vec<Option<Fit>> = lags.iter().map(|lag_s| pull.fit(motion, *lag_s)).collect();
    let without = |left_out: Option<usize>| {
        let errors: Vec<f64> =
            fits.iter().map(|fit| fit.as_ref().map_or(f64::INFINITY, |fit| fit.without(left_out))).collect();
        let best = (0..errors.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(lags.len() / 2);
        let around = best.checked_sub(1).and_then(|before| Some((*errors.get(before)?, *errors.get(best + 1)?)));
        // Minimum of the parabola through the best lag and its neighbours.
        let moved = around.map_or(0.0, |(before, after)| {
            let curvature = before - 2.0 * errors[best] + after;
            if curvature > 0.0 && curvature.is_finite() { 0.5 * (before - after) / curvature } else { 0.0 }
        });
        (lags[best] + moved * step_s, errors[best])
    };
    let (lag_s, unexplained) = without(None);
    let left_out: Vec<f64> = (0..BLOCKS).map(|block| without(Some(block)).0).collect();
    let mean = left_out.iter().sum::<f64>() / BLOCKS as f64;
    let squares: f64 = left_out.iter().map(|lag_s| (lag_s - mean).powi(2)).sum();
    (lag_s, (squares * (BLOCKS - 1) as f64 / BLOCKS as f64).sqrt(), unexplained)
}
