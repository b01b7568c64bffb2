use super::Decay;
use crate::Recordable;

/// Number of features of the readings up to now.
pub const FEATURES: usize = 7;
/// Time constants of the low-passes, s.
pub const TIME_CONSTANTS_S: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 8.0, 32.0];
/// Indices of the low-passes whose difference from the reading is a feature.
const FAR_FROM: [usize; 4] = [1, 3, 4, 5];
/// Pairs of low-passes, with time constants τ/2 and τ, whose differences are rates.
const RATES: [(usize, usize); 2] = [(0, 1), (2, 3)];
/// Gain of the rates' tanh, at which a third of the usual rate is still well distinguished from two thirds.
pub const RATE_GAIN: f64 = 3.0;

/// Largest scaled reading, in half ranges of the calibrated readings. Readings are clamped to it, so that one gross error
/// does not persist in the low-passes for minutes.
pub const FARTHEST: f64 = 3.0;

/// Maximum number of surprising readings in a row that are skipped as spikes. If there are more, the law is at fault,
/// and the features need the readings.
const PASSED_OVER: f64 = 3.0;

/// Scale of the readings `R/R₀ - 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct FeatureScale<T> {
    /// The reading that counts as zero: the middle of the range in calibration.
    pub centre: T,
    /// Distance from `centre` that counts as one.
    pub half_range: T,
    /// Standard deviation of the two rates, in half ranges.
    pub rates: [T; 2],
    /// Starting values of the low-passes: a and b of a + b y at the first reading y.
    pub starts: Starts<T>,
}

impl FeatureScale<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> FeatureScale<T> {
        FeatureScale {
            centre: T::of(self.centre),
            half_range: T::of(self.half_range),
            rates: self.rates.map(T::of),
            starts: self.starts.map(|line| line.map(T::of)),
        }
    }

    /// Returns the scale for features of the future. Their low-passes start settled on the last reading: with fitted starts,
    /// smoothers were overconfident in other motions.
    #[must_use]
    pub fn future(self) -> Self {
        Self { starts: settled(), ..self }
    }
}

/// Coefficients a, b of the starting values a + b y of the low-passes.
pub type Starts<T> = [[T; 2]; TIME_CONSTANTS_S.len()];

/// Returns the starting values of low-passes that have settled on the first reading.
#[must_use]
pub fn settled<T: Recordable>() -> Starts<T> {
    [[T::zero(), T::one()]; TIME_CONSTANTS_S.len()]
}

/// Features that a correction computes from the readings up to now: the scaled reading, its differences from low-passes of 0.5, 2,
/// 8 and 32 s, and two rates, bounded by a tanh.
///
/// A missing reading leaves the features unchanged; the next reading then covers the whole time since the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReadingFeatures<T> {
    scale: FeatureScale<T>,
    pub(crate) low_passes: [T; TIME_CONSTANTS_S.len()],
    /// Time since the last reading, s.
    pub(crate) waited_s: T,
    /// Number of surprising readings in a row, three at most.
    pub(crate) surprises: T,
    /// True if the last row had no reading, or a skipped one.
    pub(crate) waits: bool,
    pub(crate) now: Option<[T; FEATURES]>,
}

impl<T: Recordable> ReadingFeatures<T> {
    /// Starts before the first reading.
    #[must_use]
    pub fn new(scale: FeatureScale<T>) -> Self {
        let low_passes = [T::zero(); TIME_CONSTANTS_S.len()];
        Self { scale, low_passes, waited_s: T::zero(), surprises: T::zero(), waits: false, now: None }
    }

    /// Takes the reading `R/R₀ - 1` of a row `dt_s ≥ 0` seconds after the previous row; `None` if it is missing. Returns
    /// the features: `None` before the first reading.
    pub fn step(&mut self, dt_s: T, reading: Option<T>) -> Option<[T; FEATURES]> {
        self.step_with(dt_s, reading, |waited_s| TIME_CONSTANTS_S.map(|tau_s| Decay::over(waited_s, T::of(tau_s))))
    }

    /// Takes a step like [`Self::step`], with given `decays` of the low-passes as a function of time, s.
    pub fn step_with(
        &mut self,
        dt_s: T,
        reading: Option<T>,
        decays: impl FnOnce(T) -> [Decay<T>; TIME_CONSTANTS_S.len()],
    ) -> Option<[T; FEATURES]> {
        self.waited_s += dt_s;
        self.waits = reading.is_none();
        if let Some(reading) = reading {
            let scaled = (reading - self.scale.centre) / self.scale.half_range;
            let scaled = scaled.max(-T::of(FARTHEST)).min(T::of(FARTHEST));
            if let Some([last, ..]) = self.now {
                let all = self.low_passes.iter_mut().zip(decays(self.waited_s));
                all.for_each(|(low_pass, decay)| *low_pass = decay.moved(*low_pass, last, scaled));
            } else {
                let all = self.low_passes.iter_mut().zip(self.scale.starts);
                all.for_each(|(low_pass, [a, b])| *low_pass = a + b * scaled);
            }
            self.waited_s = T::zero();
            self.now = Some(self.features(scaled));
        }
        self.now
    }

    /// Takes a step like [`Self::step`], but a reading that surprises the filter counts as missing, unless the three readings
    /// before it surprised it, too.
    pub fn step_unless(&mut self, surprises: bool, dt_s: T, reading: Option<T>) -> Option<[T; FEATURES]> {
        let reading = self.unless(surprises, reading);
        self.step(dt_s, reading)
    }

    /// Returns the reading to pass to [`Self::step`]: `None` for one that surprises the filter, unless the three readings
    /// before it surprised it, too.
    pub fn unless(&mut self, surprises: bool, reading: Option<T>) -> Option<T> {
        let (before, most) = (self.surprises, T::of(PASSED_OVER));
        let reading = reading?;
        self.surprises = if surprises { most.min(before + T::one()) } else { T::zero() };
        if surprises && before < most { None } else { Some(reading) }
    }

    /// True if the last row had no reading, or a skipped one.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.waits
    }

    /// Returns the features at the last reading; `None` before the first.
    #[must_use]
    pub fn now(&self) -> Option<[T; FEATURES]> {
        self.now
    }

    fn features(&self, scaled: T) -> [T; FEATURES] {
        let low = &self.low_passes;
        let [a, b, c, d] = FAR_FROM.map(|place| scaled - low[place]);
        let [fast, slow] = self.rates();
        let bounded = |rate: T, usual: T| (T::of(RATE_GAIN) * rate / usual).tanh();
        [scaled, a, b, c, d, bounded(fast, self.scale.rates[0]), bounded(slow, self.scale.rates[1])]
    }

    /// Returns the low-passes at the last reading, in half ranges, from which a calibration derives
    /// [`FeatureScale::starts`].
    #[must_use]
    pub const fn low_passes(&self) -> [T; TIME_CONSTANTS_S.len()] {
        self.low_passes
    }

    /// Returns the two rates at the last reading before the tanh, in half ranges, from which a calibration derives
    /// [`FeatureScale::rates`].
    #[must_use]
    pub fn rates(&self) -> [T; 2] {
        RATES.map(|(sooner, later)| self.low_passes[sooner] - self.low_passes[later])
    }
}
