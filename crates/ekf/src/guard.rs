use ohmstrain_model::Scalar;

use crate::{Advanced, Estimator, Reading, State, StepError};

/// Protects an estimator from outliers: a gate that turns readings down, and a bounded influence for those it lets pass.
///
/// A gate alone can lock a filter out: one wrong rejection, and every later reading looks wrong too. After `patience`
/// rejections in a row it is the state that is wrong. Its covariance is inflated until the reading is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard<T> {
    gate: T,
    influence: Influence<T>,
    patience: u32,
}

/// How much a reading may move the state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Influence<T> {
    /// As much as the Kalman gain says.
    Full,
    /// No more than an innovation of `threshold` standard deviations (Huber, *Ann. Math. Stat.* 35 (1964) 73).
    Huber {
        /// In standard deviations; 1.345 costs 5 % of efficiency on Gaussian readings.
        threshold: T,
    },
    /// As if innovations followed Student's t: the weight `(ν + 1)/(ν + NIS)` falls toward zero for large ones (Lange,
    /// Little, Taylor, *J. Am. Stat. Assoc.* 84 (1989) 881), and never exceeds one.
    StudentT {
        /// ν, above zero; 4 is usual.
        degrees_of_freedom: T,
    },
}

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReadingVerdict {
    /// There was none.
    Missing,
    /// Taken as it is.
    Accepted,
    /// Taken with less weight.
    Downweighted,
    /// Turned down; the step was a prediction.
    Rejected,
    /// Taken, and the state's confidence lowered, because too many in a row were turned down.
    Readmitted,
}

/// Rejections in a row; the caller keeps it beside the state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Streak(u32);

/// A step under guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarded<S, T> {
    /// What the estimator said of the reading as it came: its innovation is that of the unguarded step.
    pub advanced: Advanced<S, T>,
    /// The state from which the step was taken, for a smoother: the caller's, or that one inflated.
    pub from: S,
    /// The reading as it was used.
    pub used: Option<Reading<T>>,
    /// What became of the reading.
    pub verdict: ReadingVerdict,
    /// Rejections in a row, this one included.
    pub streak: Streak,
}

/// Growth of the covariance per readmission, at most: deviations by a thousand, which no sensible state survives.
const MOST_INFLATION: f64 = 1e6;

impl<T: Scalar> Guard<T> {
    /// A guard that lets everything pass.
    #[must_use]
    pub fn none() -> Self {
        Self { gate: T::one() / T::zero(), influence: Influence::Full, patience: 0 }
    }

    /// Turns down readings with a normalised innovation squared above `nis`, `patience` of them in a row at most.
    /// χ² with one degree of freedom exceeds 10.8 once in a thousand.
    #[must_use]
    pub fn with_gate(self, nis: T, patience: u32) -> Self {
        Self { gate: nis, patience, ..self }
    }

    /// Bounds the influence of the readings that pass the gate.
    #[must_use]
    pub fn with_influence(self, influence: Influence<T>) -> Self {
        Self { influence, ..self }
    }

    /// Whether everything passes as it is.
    #[must_use]
    pub fn is_none(&self) -> bool {
        !self.gate.is_finite() && self.influence == Influence::Full
    }

    /// A step of `estimator` under guard.
    ///
    /// # Errors
    /// See [`StepError`]; state and streak are the caller's and stay as they were.
    pub fn advance<E: Estimator<T, N, L>, const N: usize, const L: usize>(
        &self,
        estimator: &E,
        state: &E::State,
        streak: Streak,
        prepared: &E::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Guarded<E::State, T>, StepError> {
        let plain = estimator.advance(state, prepared, reading)?;
        let (Some(reading), Some(innovation)) = (reading, plain.innovation) else {
            return Ok(Guarded {
                advanced: plain,
                from: state.clone(),
                used: None,
                verdict: ReadingVerdict::Missing,
                streak,
            });
        };
        let nis = innovation.nis();
        // A NIS that is not a number must not pass.
        let passes = nis <= self.gate;
        let (verdict, from, used, streak) = if passes {
            let weight = self.influence.weight(nis);
            if weight >= T::one() {
                let used = Some(reading);
                return Ok(Guarded {
                    advanced: plain,
                    from: state.clone(),
                    used,
                    verdict: ReadingVerdict::Accepted,
                    streak: Streak(0),
                });
            }
            // S / w instead of S: the gain, and with it the step, is w times as large.
            let extra_variance = reading.extra_variance + innovation.variance * (T::one() / weight - T::one());
            (ReadingVerdict::Downweighted, state.clone(), Some(Reading { extra_variance, ..reading }), Streak(0))
        } else if streak.0 < self.patience {
            (ReadingVerdict::Rejected, state.clone(), None, Streak(streak.0 + 1))
        } else {
            let inflated = state.inflated(nis.min(T::of(MOST_INFLATION)));
            (ReadingVerdict::Readmitted, inflated, Some(reading), streak)
        };
        let taken = estimator.advance(&from, prepared, used)?;
        let advanced = Advanced { innovation: Some(innovation), ..taken };
        Ok(Guarded { advanced, from, used, verdict, streak })
    }
}

impl<T: Scalar> Influence<T> {
    /// Weight of an innovation, 0 to 1.
    fn weight(&self, nis: T) -> T {
        match *self {
            Self::Full => T::one(),
            Self::Huber { threshold } if nis > threshold * threshold => threshold / nis.sqrt(),
            Self::Huber { .. } => T::one(),
            Self::StudentT { degrees_of_freedom } => {
                ((degrees_of_freedom + T::one()) / (degrees_of_freedom + nis)).min(T::one())
            }
        }
    }
}
