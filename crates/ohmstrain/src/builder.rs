use std::sync::Arc;

use ohmstrain_ekf::live::{DOUBT, Doubts, Protections};
use ohmstrain_ekf::{Guard, Influence};
use ohmstrain_sensor::{EstimatorKind, KnownErrors, Options, SensorError, Start};

use crate::estimate::{Scale, check_known};
use crate::filter::{Kernel, RowWriter};
use crate::known::in_order;
use crate::stored::{MadeOf, StoredOptions};
use crate::{Error, Filter, Known, LaggedFilter, Sensor, Stored, StoredError};

/// Number of consecutive readings that a gate may reject; a further one makes the filter doubt its state instead. Outliers come
/// alone, but a body that starts to move causes surprises until the filter follows. With ten, a knee bend within half a second
/// was missed.
const PATIENCE: u32 = 2;
/// Default influence of a surprising reading. On five public recordings of two materials it adds at most one hundredth to the
/// error if nothing is wrong (Student's t with four degrees of freedom adds a tenth on two of them).
pub(crate) const INFLUENCE: Influence<f64> = Influence::Redescending { threshold: 3.0 };

/// Options of a filter; see [`Sensor::filter`]. Everything has a default.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// use ohmstrain::{EstimatorKind, Influence};
///
/// let filter = sensor
///     .filter()
///     .estimator(EstimatorKind::Ekf)
///     .rest_resistance(1580.0)
///     .initial_strain(0.0)
///     .gate(10.8)
///     .influence(Influence::Huber { threshold: 2.0 })
///     .build()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FilterBuilder<'a> {
    pub(crate) sensor: &'a Sensor,
    estimator: Option<EstimatorKind>,
    corrects: bool,
    pub(crate) rest_resistance: Option<f64>,
    pub(crate) initial_strain: Option<f64>,
    pub(crate) known: &'a [Known],
    gate: Option<f64>,
    influence: Influence<f64>,
    protections: Protections,
}

impl<'a> FilterBuilder<'a> {
    pub(crate) const fn new(sensor: &'a Sensor) -> Self {
        Self {
            sensor,
            estimator: None,
            corrects: true,
            rest_resistance: None,
            initial_strain: None,
            known: &[],
            gate: None,
            influence: INFLUENCE,
            protections: Protections::ALL,
        }
    }

    /// Selects another estimator than the sensor's default.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let ekf = sensor.filter().estimator(ohmstrain::EstimatorKind::Ekf).build()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn estimator(self, kind: EstimatorKind) -> Self {
        Self { estimator: Some(kind), ..self }
    }

    /// Turns off the learned correction of the strain.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let plain = sensor.filter().without_correction().build()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn without_correction(self) -> Self {
        Self { corrects: false, ..self }
    }

    /// Sets the present reading of the rested, unstretched sensor, in place of that in calibration: for another day, or another
    /// sensor of the same make. It may differ by a factor of [`FARTHEST_REST`](crate::FARTHEST_REST) at most. Without
    /// it, R₀ adapts to readings that stay outside the calibrated range
    /// ([`RestFollower`](ohmstrain_ekf::live::RestFollower)).
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let today = sensor.filter().rest_resistance(1712.0).build()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn rest_resistance(self, measured: f64) -> Self {
        Self { rest_resistance: Some(measured), ..self }
    }

    /// Sets the strain (or angle) at the first row, if it is known; the body is at rest there.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert!(sensor.filter().initial_strain(0.1).build().is_ok());
    /// assert!(sensor.filter().initial_strain(10.0).build().is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn initial_strain(self, strain: f64) -> Self {
        Self { initial_strain: Some(strain), ..self }
    }

    /// Sets strains (or angles) that are known at certain times, in any order. Each shows the error of the estimate at its
    /// time, which corrects later rows (in a smoother, rows before it, too): for seconds, and for an hour as far as known
    /// strains show an offset or another gain.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::Known;
    ///
    /// let known = [Known::new(0.0, 0.0), Known { sd: Some(0.002), ..Known::new(0.1, 0.10) }];
    /// let rows = sensor.filter().known(&known).smooth(&[0.00, 0.05, 0.10], &[1600.0, 1632.0, 1660.0])?;
    /// assert!(rows[0].strain < 0.005 && (rows[2].strain - 0.10).abs() < 0.005);
    /// let mut filter = sensor.filter().known(&known).build()?;
    /// assert!(filter.step(0.0, 1600.0)?.strain < 0.005);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn known(self, known: &'a [Known]) -> Self {
        Self { known, ..self }
    }

    /// Rejects readings with a NIS (squared innovation over its variance) above `nis`, at most two in a row. A threshold of
    /// 10.8 rejects one good reading in a thousand.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert!(sensor.filter().gate(10.8).build().is_ok());
    /// assert!(sensor.filter().gate(-1.0).build().is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn gate(self, nis: f64) -> Self {
        Self { gate: Some(nis), ..self }
    }

    /// Sets the influence of surprising readings. By default it decreases with the distance beyond three standard deviations;
    /// [`Influence::Full`] takes every reading as it is.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::Influence;
    ///
    /// let trusting = sensor.filter().influence(Influence::Full).build()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn influence(self, influence: Influence<f64>) -> Self {
        Self { influence, ..self }
    }

    /// Turns off the plausibility check: every finite reading is used, whatever the calibrated range, and a repeated number
    /// never counts as stuck.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::Flag;
    ///
    /// let unplugged = |row: ohmstrain::FilterBuilder| row.build()?.step(0.0, 210_000.0);
    /// assert!(unplugged(sensor.filter())?.flags.has(Flag::Implausible));
    /// assert!(!unplugged(sensor.filter().without_plausibility())?.flags.has(Flag::Implausible));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn without_plausibility(self) -> Self {
        Self { protections: Protections { plausibility: false, ..self.protections }, ..self }
    }

    /// Turns off the second look after a jump of the readings, a second hypothesis that starts from the prior, and the way back to
    /// the state before a jump if readings jump back. A smoother never has them.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let steady = sensor.filter().without_second_look().build()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn without_second_look(self) -> Self {
        Self { protections: Protections { second_look: false, ..self.protections }, ..self }
    }

    /// Leaves intervals as the filter states them. They are not widened at the start, in recovery after a fault, outside the
    /// calibrated range, or with another R₀. A smoother widens its intervals for the same reasons, except at the start and in
    /// recovery.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let first = |row: ohmstrain::FilterBuilder| row.build()?.step(0.0, 1600.0);
    /// assert!(first(sensor.filter().without_doubts())?.strain_sd < first(sensor.filter())?.strain_sd);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn without_doubts(self) -> Self {
        Self { protections: Protections { doubts: false, ..self.protections }, ..self }
    }

    /// Builds a filter that estimates each row from the readings up to it.
    ///
    /// # Errors
    /// If the sensor has no parameters for the estimator, or an option is invalid for it.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build()?;
    /// std::thread::spawn(move || filter.step(0.0, 1600.0)).join().unwrap()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn build(self) -> Result<Filter, Error> {
        Ok(Filter::new(self.kernel()?))
    }

    /// Builds a filter that estimates each row from the readings up to `lag_s` seconds after it.
    ///
    /// # Errors
    /// As [`Self::build`]; or if the estimator cannot look back.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(0.2)?;
    /// for row in filter.step(0.0, 1600.0)? {
    ///     println!("{} s: {:.3} ± {:.3}", row.time_s, row.strain, row.strain_sd);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn build_lagged(self, lag_s: f64) -> Result<LaggedFilter, Error> {
        if !(lag_s.is_finite() && lag_s > 0.0) {
            return Err(Error::NotPositive { name: "lag", found: lag_s });
        }
        Ok(LaggedFilter::new(self.kernel()?, lag_s))
    }

    /// Builds a filter that resumes from a stored one of the same sensor and options, to the bit. R₀ and known strains come
    /// from the state; known strains given here are added, unless they are of earlier rows.
    ///
    /// # Errors
    /// If the state is of another sensor, other options or another version; or if an initial strain is given, since the first
    /// row is over.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let stored = sensor.filter().build()?.store()?;
    /// assert!(sensor.filter().resume(&stored).is_ok());
    /// let refused = sensor.filter().gate(10.8).resume(&stored).unwrap_err();
    /// assert!(refused.to_string().contains("gate"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn resume(self, stored: &Stored) -> Result<Filter, Error> {
        let mut filter = self.without_start()?.build()?;
        filter.resume(stored)?;
        self.rest_resistance.map_or(Ok(()), |measured| filter.rest_resistance(measured))?;
        Ok(filter)
    }

    /// Resumes a filter with a lag.
    ///
    /// # Errors
    /// As [`Self::resume`].
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let stored = sensor.filter().build_lagged(0.2)?.store()?;
    /// assert!(sensor.filter().resume_lagged(0.2, &stored).is_ok());
    /// assert!(sensor.filter().resume_lagged(0.3, &stored).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn resume_lagged(self, lag_s: f64, stored: &Stored) -> Result<LaggedFilter, Error> {
        let mut filter = self.without_start()?.build_lagged(lag_s)?;
        filter.resume(stored)?;
        self.rest_resistance.map_or(Ok(()), |measured| filter.rest_resistance(measured))?;
        Ok(filter)
    }

    /// Refuses an initial strain for a filter that has begun.
    fn without_start(self) -> Result<Self, Error> {
        if self.initial_strain.is_some() { Err(StoredError::Begun.into()) } else { Ok(self) }
    }

    /// Returns the chosen estimator.
    pub(crate) fn kind(&self) -> EstimatorKind {
        let kind = self.estimator.unwrap_or(self.sensor.params().default_estimator);
        if self.corrects { kind } else { self.sensor.params().without_correction(kind) }
    }

    /// Returns the estimator that smooths for the chosen one.
    pub(crate) fn smoothers_kind(&self) -> EstimatorKind {
        if self.corrects { self.sensor.params().smoother_of(self.kind()) } else { self.kind() }
    }

    /// Builds the forward filter, with its conversion to rows.
    fn kernel(self) -> Result<Kernel, Error> {
        let kind = self.kind();
        let mut filter = self.sensor.build(kind, &self.options()?)?;
        let scale = self.scale()?;
        if let Some(measured) = self.rest_resistance {
            filter.rest(measured).map_err(Error::Step)?;
        }
        let (known, errors) = (in_order(self.known, &scale)?, KnownErrors::new(scale.limits));
        let made_of = MadeOf {
            params: Arc::clone(self.sensor.shared()),
            options: StoredOptions::new(kind, self.gate, self.influence, self.protections),
        };
        Ok(Kernel { filter, rows: RowWriter { scale, errors }, known, made_of })
    }

    /// Returns the scale of the rows, with R₀ as given.
    pub(crate) fn scale(self) -> Result<Scale, Error> {
        let mut scale = Scale::new(self.sensor)?;
        self.rest_resistance.map_or(Ok(()), |measured| scale.rest_at(measured))?;
        Ok(scale)
    }

    /// Returns the options of filter and smoother.
    pub(crate) fn options(self) -> Result<Options, Error> {
        let start = self.initial_strain.map_or(Ok(Start::Unknown), |strain| self.start_at(strain))?;
        Ok(Options { start, guard: self.guard()?, protections: self.protections })
    }

    /// Returns the doubts of a smoother; `None` if they are turned off.
    pub(crate) fn smoothers_doubts(self, kind: EstimatorKind) -> Result<Option<Doubts<f64>>, Error> {
        let params = self.sensor.params();
        let motion = &params.estimator(params.filter_of(kind)).map_err(SensorError::from)?.motion;
        let doubts = self.protections.doubts.then(|| Doubts::new(params.smoothers_doubts(motion)));
        let of_known = |doubts: Doubts<f64>, strain| doubts.of_known_strain(self.is_at_rest(strain));
        Ok(doubts.map(|doubts| self.initial_strain.map_or(doubts, |strain| of_known(doubts, strain))))
    }

    /// True if a strain is zero, apart from rounding.
    pub(crate) fn is_at_rest(&self, strain: f64) -> bool {
        strain.abs() <= DOUBT.zero * self.sensor.params().limits.span()
    }

    fn start_at(&self, strain: f64) -> Result<Start, Error> {
        let params = self.sensor.params();
        check_known("initial strain", strain, params.limits, params.quantity)?;
        Ok(Start::Strain(strain))
    }

    fn guard(&self) -> Result<Guard<f64>, Error> {
        let mut guard = Guard::none();
        if let Some(nis) = self.gate {
            guard = guard.with_gate(nis, PATIENCE).map_err(Error::Guard)?;
        }
        guard.with_influence(self.influence).map_err(Error::Guard)
    }
}
