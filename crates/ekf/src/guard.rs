use ohmstrain_model::{Number, ParameterError, Problem, Scalar};

use crate::{Advanced, Estimator, Innovation, Reading, State, StepError};

/// Protects an estimator from outliers: a gate rejects readings, and readings that pass it have a bounded influence.
///
/// A gate alone can lock a filter out: after one wrong rejection, every later reading may look wrong too. After `patience`
/// rejections in a row, the state itself may be wrong. Its covariance is then inflated just enough for the reading to lie on
/// the gate, at most tenfold, and at most three times until a reading passes by itself. The limits preserve the filter's
/// estimates of drift and relaxation. A reading still beyond the gate is taken with Huber's weight.
///
/// A reading too far away for floating-point numbers is rejected, with or without a gate; it is never an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard<T> {
    gate: T,
    influence: Influence<T>,
    patience: u32,
}

/// Limit on how far a reading may move the state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Influence<T> {
    /// No limit: the full Kalman gain.
    Full,
    /// No more than an innovation of `threshold` standard deviations (Huber, *Ann. Math. Stat.* 35 (1964) 73).
    Huber {
        /// Number of standard deviations; 1.345 costs 5 % of efficiency on Gaussian readings.
        threshold: T,
    },
    /// The full gain up to `threshold` standard deviations, and less beyond: an innovation of z standard deviations
    /// counts as threshold²/z. It has no cost without outliers, and a far outlier has almost no effect. A redescending
    /// influence (Hampel, *J. Am. Stat. Assoc.* 69 (1974) 383), with the tail of Student's t.
    Redescending {
        /// Number of standard deviations.
        threshold: T,
    },
    /// Innovations with Student's t distribution: the weight `(ν + 1)/(ν + NIS)` falls toward zero for large ones (Lange,
    /// Little, Taylor, *J. Am. Stat. Assoc.* 84 (1989) 881), and never exceeds one.
    StudentT {
        /// ν, above zero; 4 is usual.
        degrees_of_freedom: T,
    },
}

/// Verdict of the guard on a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReadingVerdict {
    /// Missing reading.
    Missing,
    /// Taken with its full weight.
    Accepted,
    /// Taken with reduced weight.
    Downweighted,
    /// Rejected; the step was a prediction.
    Rejected,
    /// Taken with the influence of a reading on the gate, after the state's covariance was inflated, because too many in a
    /// row were rejected.
    Readmitted,
    /// Not a possible reading of this sensor; ignored, however often it comes.
    Implausible,
    /// The same number for longer than a working sensor repeats it; it carries no new information.
    Stuck,
}

impl ReadingVerdict {
    /// True if the reading has updated the state.
    #[must_use]
    pub const fn is_taken(self) -> bool {
        matches!(self, Self::Accepted | Self::Downweighted | Self::Readmitted)
    }

    /// True for a possible reading that was not used. An implausible reading counts as missing instead.
    #[must_use]
    pub const fn is_refused(self) -> bool {
        matches!(self, Self::Rejected | Self::Stuck)
    }
}

/// Number of rejections in a row, stored by the caller beside the state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Streak(u32);

/// A step under guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarded<S, T> {
    /// The step that was taken. Its innovation is that of the original reading; `None` if that was too far away to have one.
    pub advanced: Advanced<S, T>,
    /// Factor on the covariance of the state before the step ([`State::inflated`]), for a smoother; 1 except at a
    /// readmission.
    pub inflation: T,
    /// Reading as used, with its extra variance.
    pub used: Option<Reading<T>>,
    /// Verdict on the reading.
    pub verdict: ReadingVerdict,
    /// Rejections in a row, this one included.
    pub streak: Streak,
}

/// Largest growth of the covariance per readmission. The constant below is the largest number of inflations in a row.
const MOST_INFLATION: f64 = 10.0;
const MOST_INFLATIONS: u32 = 3;

impl<T: Scalar> Guard<T> {
    /// Returns a guard that accepts every reading.
    #[must_use]
    pub fn none() -> Self {
        Self { gate: T::one() / T::zero(), influence: Influence::Full, patience: 0 }
    }

    /// Rejects readings with a normalised innovation squared above `nis`, at most `patience` of them in a row. χ² with
    /// one degree of freedom exceeds 10.8 once in a thousand.
    ///
    /// # Errors
    /// If `nis` is not positive.
    pub fn with_gate(self, nis: T, patience: u32) -> Result<Self, ParameterError> {
        if !(nis > T::zero()) {
            return Err(ParameterError::new("gate", Problem::NotPositive));
        }
        Ok(Self { gate: nis, patience, ..self })
    }

    /// Bounds the influence of the readings that pass the gate.
    ///
    /// # Errors
    /// If its parameter is not positive.
    pub fn with_influence(self, influence: Influence<T>) -> Result<Self, ParameterError> {
        let (name, value) = match influence {
            Influence::Full => return Ok(Self { influence, ..self }),
            Influence::Huber { threshold } | Influence::Redescending { threshold } => ("threshold", threshold),
            Influence::StudentT { degrees_of_freedom } => ("degrees_of_freedom", degrees_of_freedom),
        };
        if !(value > T::zero()) {
            return Err(ParameterError::new(name, Problem::NotPositive));
        }
        Ok(Self { influence, ..self })
    }

    /// Advances `estimator` under guard.
    ///
    /// # Errors
    /// See [`StepError`]; the caller's state and streak are unchanged.
    pub fn advance<E: Estimator<T, N, L>, const N: usize, const L: usize>(
        &self,
        estimator: &E,
        state: &E::State,
        streak: Streak,
        prepared: &E::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Guarded<E::State, T>, StepError> {
        let guarded = |advanced, used, verdict, streak| {
            Ok(Guarded { advanced, inflation: T::one(), used, verdict, streak: Streak(streak) })
        };
        let Some(reading) = reading else {
            let advanced = estimator.advance(state, prepared, None)?;
            return guarded(advanced, None, ReadingVerdict::Missing, streak.0);
        };
        let seen = taken_as(estimator, state, prepared, reading)?;
        let innovation = seen.as_ref().map(|(_, innovation)| *innovation);
        let as_it_came = |advanced: Advanced<E::State, T>| Advanced { innovation, ..advanced };
        let rejected = || {
            let advanced = estimator.advance(state, prepared, None)?;
            let streak = streak.0.saturating_add(1);
            guarded(as_it_came(advanced), None, ReadingVerdict::Rejected, streak)
        };
        let Some((plain, innovation)) = seen else { return rejected() };
        let nis = innovation.nis;
        // A NIS that is NaN or negative must not pass.
        if nis >= T::zero() && nis <= self.gate {
            let weight = self.influence.weight(nis);
            if weight >= T::one() {
                return guarded(plain, Some(reading), ReadingVerdict::Accepted, 0);
            }
            let used = reading.weighted(weight, innovation.variance);
            let Some((advanced, _)) = taken_as(estimator, state, prepared, used)? else { return rejected() };
            return guarded(as_it_came(advanced), Some(used), ReadingVerdict::Downweighted, 0);
        }
        if streak.0 < self.patience || !(nis >= T::zero() && nis.is_finite()) {
            return rejected();
        }
        let inflates = streak.0 - self.patience < MOST_INFLATIONS;
        let inflation = if inflates { (nis / self.gate).min(T::of(MOST_INFLATION)) } else { T::one() };
        let from = state.inflated(inflation);
        let Some((_, wider)) = taken_as(estimator, &from, prepared, reading)? else { return rejected() };
        let weight = (self.gate / wider.nis).sqrt().min(T::one());
        let used = reading.weighted(weight, wider.variance);
        let advanced = estimator.advance(&from, prepared, Some(used))?;
        let streak = streak.0.saturating_add(1);
        let readmitted = guarded(as_it_came(advanced), Some(used), ReadingVerdict::Readmitted, streak)?;
        Ok(Guarded { inflation, ..readmitted })
    }
}

/// Returns the step with the unchanged reading, and its innovation; `None` if floating-point numbers cannot represent
/// the result.
#[allow(clippy::type_complexity, reason = "a state with what it was compared with")]
fn taken_as<T: Scalar, E: Estimator<T, N, L>, const N: usize, const L: usize>(
    estimator: &E,
    state: &E::State,
    prepared: &E::Prepared,
    reading: Reading<T>,
) -> Result<Option<(Advanced<E::State, T>, Innovation<T>)>, StepError> {
    match estimator.advance(state, prepared, Some(reading)) {
        Err(error) if error.is_of_the_reading() => Ok(None),
        taken => {
            let taken = taken?;
            Ok(taken.innovation.map(|innovation| (taken, innovation)))
        }
    }
}

impl<T: Number> Influence<T> {
    /// Returns the weight, 0 to 1, of an innovation with this normalised square.
    pub fn weight(&self, nis: T) -> T {
        match *self {
            Self::Full => T::one(),
            Self::Huber { threshold } if nis > threshold * threshold => threshold / nis.sqrt(),
            Self::Redescending { threshold } if nis > threshold * threshold => threshold * threshold / nis,
            Self::Huber { .. } | Self::Redescending { .. } => T::one(),
            Self::StudentT { degrees_of_freedom } => {
                ((degrees_of_freedom + T::one()) / (degrees_of_freedom + nis)).min(T::one())
            }
        }
    }
}
