use std::ops::Range;

use ohmstrain_ekf::live::RestFollower;
use ohmstrain_ekf::{Gaussian, StepError};
use ohmstrain_sensor::{EstimatorKind, KnownStrain, Rows, Stated};

use crate::estimate::Scale;
use crate::known::{KnownOfAll, in_order, next_until};
use crate::pauses::Pauses;
use crate::{Error, Estimate, FilterBuilder, Reading};

/// Smoothing of whole recordings.
impl FilterBuilder<'_> {
    /// Smooths a whole recording: each estimate uses all readings; a missing reading is NaN.
    ///
    /// # Errors
    /// As [`Sensor::smooth`](crate::Sensor::smooth).
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let rows = sensor.filter().gate(10.8).smooth(&[0.00, 0.05], &[1600.0, 1632.0])?;
    /// assert_eq!(rows.len(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn smooth(self, time_s: &[f64], readings: &[f64]) -> Result<Vec<Estimate>, Error> {
        if time_s.len() != readings.len() {
            return Err(Error::Lengths { times: time_s.len(), readings: readings.len() });
        }
        self.sensor.check_unit(readings.iter().copied(), self.rest_resistance)?;
        self.smooth_readings(time_s, &readings.iter().copied().map(Reading::from).collect::<Vec<_>>())
    }

    /// Smooths a whole recording of readings that may be a converter's; their unit is not checked.
    ///
    /// # Errors
    /// As [`Self::build`]; the row that was refused; or times and readings of different number.
    pub fn smooth_readings(self, time_s: &[f64], readings: &[Reading]) -> Result<Vec<Estimate>, Error> {
        if time_s.len() != readings.len() {
            return Err(Error::Lengths { times: time_s.len(), readings: readings.len() });
        }
        let mut rows = Vec::with_capacity(time_s.len());
        self.smooth_backward(
            time_s.len(),
            |row| (time_s[row], readings[row]),
            |_, segment| {
                rows.extend(segment.iter().rev());
                Ok::<(), Error>(())
            },
        )?;
        rows.reverse();
        Ok(rows)
    }

    /// Smooths a recording whose estimates do not fit into memory. `row` returns time, s, and reading of each of `len` rows;
    /// `take` receives the estimates segment by segment, the last segment first, each in order of time.
    ///
    /// # Errors
    /// As [`Self::build`]; the row that was refused; or the error of `take`.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{Error, Reading};
    ///
    /// let row = |k: usize| (0.05 * k as f64, Reading::from(1600.0 + k as f64));
    /// sensor.filter().smooth_backward(10_000, row, |rows, estimates| {
    ///     println!("rows {rows:?}: {} estimates", estimates.len());
    ///     Ok::<(), Error>(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn smooth_backward<E: From<Error>>(
        self,
        len: usize,
        row: impl Fn(usize) -> (f64, Reading),
        take: impl FnMut(Range<usize>, &[Estimate]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut known = self.known_of_all(len, &row)?;
        self.smooth_with(len, row, |_, time_s, estimated| known.correct(time_s, estimated), take)
    }

    /// Computes the errors at known strains for all rows of a recording. That takes a smoothing pass of its own.
    fn known_of_all(self, len: usize, row: &impl Fn(usize) -> (f64, Reading)) -> Result<KnownOfAll, Error> {
        let scale = Scale::new(self.sensor)?;
        let mut due = in_order(self.known, &scale)?;
        let mut known: Vec<(usize, KnownStrain)> = Vec::new();
        let mut k = 0;
        while k < len && !due.is_empty() {
            let time_s = row(k).0;
            while let Some(strain) = next_until(&mut due, time_s) {
                let estimated = Stated { strain, doubted: 0.0 };
                known.push((k, KnownStrain { time_s, known: strain, estimated }));
            }
            k += 1;
        }
        if !known.is_empty() {
            let listen = |k: usize, _: f64, estimated: Stated| {
                let first = known.partition_point(|known| known.0 < k);
                known[first..]
                    .iter_mut()
                    .take_while(|known| known.0 == k)
                    .for_each(|known| known.1.estimated = estimated);
                estimated.widened()
            };
            self.smooth_with(len, row, listen, |_, _| Ok::<(), Error>(()))?;
        }
        Ok(KnownOfAll::new(scale.limits, known.into_iter().map(|known| known.1).collect()))
    }

    /// Smooths a recording; `known` receives row, time, s, and estimated strain, and returns the strain corrected by known
    /// ones.
    fn smooth_with<E: From<Error>>(
        self,
        len: usize,
        row: impl Fn(usize) -> (f64, Reading),
        mut known: impl FnMut(usize, f64, Stated) -> Gaussian<f64>,
        mut take: impl FnMut(Range<usize>, &[Estimate]) -> Result<(), E>,
    ) -> Result<(), E> {
        let starts_known = self.initial_strain.is_some();
        let kind = self.smoothers_kind();
        let on_curve = kind == EstimatorKind::StaticCubic;
        let mut smoother = self.sensor.build_smoother(kind, &self.options()?)?;
        let (scale, mut doubts) = (self.scale()?, self.smoothers_doubts(kind)?);
        let failed = |(row, source): (usize, StepError)| Error::Row { row, source };
        let calibrated = |k: usize| {
            let (time_s, reading) = row(k);
            (time_s, reading.relative(scale.rest_reading))
        };
        let follower = self.rest_resistance.is_none().then(|| RestFollower::new(self.sensor.params().rest_bounds()));
        let begins_stretched = self.initial_strain.is_some_and(|strain| !self.is_at_rest(strain));
        let follower = follower.map(|follower| if begins_stretched { follower.stretched() } else { follower });
        let follower = follower.map(|follower| follower.settled(len, calibrated));
        let off = follower.map_or(0.0, |follower| follower.off());
        let relative = |k| {
            let (time_s, reading) = calibrated(k);
            (time_s, reading.map(|reading| follower.map_or(reading, |follower| follower.relative(reading))))
        };
        let mut back = smoother.way_back(Rows::new(len, &relative)).map_err(failed)?;
        let (mut outputs, mut estimates) = (Vec::new(), Vec::new());
        let start_s = if len > 0 { row(0).0 } else { 0.0 };
        // Time of the next reading after the row, s.
        let mut next_s = if len > 0 { row(len - 1).0 } else { 0.0 };
        let mut pauses = doubts.map(|doubts| Pauses::new(doubts.unread()));
        while let Some(rows) = back.next_segment(&mut outputs).map_err(failed)? {
            pauses.iter_mut().for_each(|pauses| pauses.widen(rows.clone(), |k| row(k).0, &mut outputs));
            estimates.clear();
            estimates.extend(rows.clone().zip(&mut outputs).rev().map(|(k, output)| {
                let (time_s, reading) = row(k);
                output.rest_off = off;
                if let Some(doubts) = doubts.as_mut().filter(|_| k > 0 || !starts_known) {
                    let estimate = &output.estimate;
                    // Doubts refer to readings relative to calibration, corrected for the session's R₀.
                    let nis = output.nis.filter(|_| !on_curve);
                    let taken = output.verdict.is_taken().then(|| (calibrated(k).1, nis));
                    let of_session = |reading| follower.map_or(reading, |follower| follower.of_session(reading));
                    let taken = taken.and_then(|(reading, nis)| Some((of_session(reading?.value), nis.unwrap_or(0.0))));
                    let unturned_s = back.turns().around(time_s);
                    doubts.see_back(time_s - start_s, next_s - time_s, unturned_s, taken);
                    next_s = if taken.is_some() { time_s } else { next_s };
                    let (widened, flags) = doubts.widened(estimate.strain, estimate.rate.mean);
                    output.widen(doubts, output.estimate.strain, widened);
                    output.doubts = flags;
                }
                output.estimate.strain = known(k, time_s, output.stated());
                scale.row(time_s, reading, output)
            }));
            estimates.reverse();
            take(rows, &estimates)?;
        }
        Ok(())
    }
}
