use std::fmt;
use std::ops::Range;

use ohmstrain_calib::{Baseline, ScoredRow, running_cubic, score, unstated};
use ohmstrain_sensor::{SensorParams, Unstated};

use crate::{Error, Reading, Sensor, Tested};

/// Smallest number of rows for a score.
const FEWEST_ROWS: usize = 10;

/// A recording of which only some rows were used for calibration.
///
/// ```
/// use ohmstrain::{Kept, Reading};
///
/// let (ohm, strain) = ([1600.0, 1632.0, 1700.0], [0.0, 0.01, 0.03]);
/// let row = |k: usize| (0.1 * k as f64, Reading::from(ohm[k]), strain[k]);
/// let kept = Kept { len: ohm.len(), row: &row, seen: 0..2 };
/// assert_eq!((kept.row)(2).2, 0.03);
/// ```
#[derive(Clone)]
pub struct Kept<'a> {
    /// Number of its rows.
    pub len: usize,
    /// Returns time, s, reading and reference of a row; NaN where the reference is unknown.
    pub row: &'a dyn Fn(usize) -> (f64, Reading, f64),
    /// Rows that were used for calibration.
    pub seen: Range<usize>,
}

impl fmt::Debug for Kept<'_> {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { len, seen, .. } = self;
        out.debug_struct("Kept").field("len", len).field("seen", seen).finish_non_exhaustive()
    }
}

/// Rows of filter, smoother and static cubic, one recording after another.
#[derive(Default)]
struct EvaluatedRows {
    filter: Vec<ScoredRow>,
    smoother: Vec<ScoredRow>,
    static_cubic: Vec<ScoredRow>,
}

impl Sensor {
    /// Scores the default estimator on all rows that were kept from its calibration, as it would run live. The returned sensor
    /// stores the scores, and covers errors beyond its intervals by widening them. The scores are `None`, and the sensor is
    /// unchanged, if there are few such rows, if their reference is constant, or if the filter refuses a row.
    ///
    /// # Errors
    /// If the resulting sensor is invalid; no case is known.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{Kept, Reading};
    ///
    /// let row = |k: usize| (0.1 * k as f64, Reading::from(1600.0 + k as f64), 0.001 * k as f64);
    /// let (sensor, tested) = sensor.tested_on(&[Kept { len: 50, row: &row, seen: 0..20 }])?;
    /// assert_eq!(tested.map(|tested| tested.filter.n), Some(30));
    /// assert!(sensor.params().tested.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn tested_on(self, kept: &[Kept]) -> Result<(Self, Option<Tested>), Error> {
        let Some((tested, unstated)) = self.tested(kept) else { return Ok((self, None)) };
        let params = self.into_params();
        let unstated = Unstated {
            filter_sd: params.unstated.filter_sd.hypot(unstated.filter_sd),
            smoother_sd: params.unstated.smoother_sd.hypot(unstated.smoother_sd),
        };
        let sensor = Self::from_params(SensorParams { tested: Some((&tested).into()), unstated, ..params })?;
        Ok((sensor, Some(tested)))
    }

    fn tested(&self, kept: &[Kept]) -> Option<(Tested, Unstated)> {
        let mut rows = EvaluatedRows::default();
        for recording in kept {
            rows.add(recording, self)?;
        }
        if rows.filter.len() < FEWEST_ROWS {
            return None;
        }
        let tested = Tested { filter: score(&rows.filter)?, static_cubic: score(&rows.static_cubic)? };
        let is_known = tested.filter.rmse_percent_fs.is_finite();
        is_known.then(|| (tested, unstated(&rows.filter, &rows.smoother, 1.0)))
    }
}

impl EvaluatedRows {
    /// Runs filter, smoother and cubic over a whole recording, and adds the held-out rows.
    fn add(&mut self, Kept { len, row, seen }: &Kept, sensor: &Sensor) -> Option<()> {
        let mut filter = sensor.filter().build().ok()?;
        let mut cubic = running_cubic(sensor.params().static_cubic);
        let read = |k: usize| {
            let (time_s, reading, _) = row(k);
            (time_s, reading)
        };
        let mut smoothed = vec![None; *len];
        let keep = |rows: Range<usize>, estimates: &[crate::Estimate]| {
            smoothed[rows].iter_mut().zip(estimates).for_each(|(place, estimate)| *place = Some(*estimate));
            Ok::<(), Error>(())
        };
        sensor.filter().smooth_backward(*len, read, keep).ok()?;
        // Times continue from recording to recording, so that none goes backwards.
        let after = self.filter.last().map_or(0.0, |row| row.time_s);
        let first_s = if *len > 0 { row(0).0 } else { 0.0 };
        for (k, smoothed) in smoothed.into_iter().enumerate() {
            let (time_s, reading, truth) = row(k);
            let filtered = filter.step(time_s, reading).ok()?;
            let strain = cubic.strain(time_s, reading.value);
            if seen.contains(&k) || !truth.is_finite() {
                continue;
            }
            let time_s = after + time_s - first_s;
            let of = |one: crate::Estimate| ScoredRow { time_s, truth, strain: one.strain, sd: Some(one.strain_sd) };
            self.filter.push(of(filtered));
            self.smoother.extend(smoothed.map(of));
            self.static_cubic.push(ScoredRow { time_s, truth, strain, sd: None });
        }
        Some(())
    }
}
