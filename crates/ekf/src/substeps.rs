use ohmstrain_model::Scalar;

use crate::{Advanced, Estimator, Innovation, Reading, StepError};

/// An estimator that takes a long step as several short ones, so that a pause in the readings may be written down as one step
/// or as many rows without a reading.
///
/// How long a step may be is for the estimator to say ([`Estimator::longest_step_s`]); a pause is divided into 128 at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substeps<E>(pub E);

/// A prepared step, and how many of it there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeated<P> {
    step: P,
    count: u8,
}

/// Into how many steps a pause is divided at most.
const MOST: u8 = 128;
/// A step of the longest length shall be one step, whatever rounding says.
pub const GRACE: f64 = 1.0005;

/// Into how many steps of `longest_s` seconds at most a step of `dt_s` seconds is divided.
pub(crate) fn count<T: Scalar>(dt_s: T, longest_s: T) -> (u8, T) {
    // Twice, since a conversion would take double precision.
    let (mut count, mut counted) = (1, T::one());
    let mut covered = longest_s * T::of(GRACE);
    let more = covered;
    while covered < dt_s && count < MOST {
        covered += more;
        count += 1;
        counted += T::one();
    }
    (count, counted)
}

impl<E> Substeps<E> {
    /// One step backwards over all that remain.
    fn smooth_back_over<T, const N: usize, const L: usize>(
        &self,
        filtered: &E::State,
        prepared: &Repeated<E::Prepared>,
        reading: Option<Reading<T>>,
        next: &E::State,
    ) -> Result<Option<E::State>, StepError>
    where
        T: Scalar,
        E: Estimator<T, N, L>,
    {
        if prepared.count <= 1 {
            return self.0.smooth_back(filtered, &prepared.step, reading, next);
        }
        // Half of them forward, the rest backward, then the first half: few states at a time.
        let half = prepared.count / 2;
        let (first, rest) =
            (Repeated { count: half, ..*prepared }, Repeated { count: prepared.count - half, ..*prepared });
        let middle = self.advance(filtered, &first, None)?.state;
        let Some(later) = self.smooth_back_over(&middle, &rest, reading, next)? else { return Ok(None) };
        self.smooth_back_over(filtered, &first, None, &later)
    }
}

impl<T, E, const N: usize, const L: usize> Estimator<T, N, L> for Substeps<E>
where
    T: Scalar,
    E: Estimator<T, N, L>,
{
    type State = E::State;
    type Prepared = Repeated<E::Prepared>;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        let (count, counted) = count(dt_s, self.0.longest_step_s());
        Repeated { step: self.0.prepare(dt_s / counted), count }
    }

    fn advance(
        &self,
        state: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<E::State, T>, StepError> {
        let mut next = state.clone();
        let innovation = self.advance_into(state, prepared, reading, &mut next)?;
        Ok(Advanced { state: next, innovation })
    }

    fn advance_into(
        &self,
        state: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
        next: &mut E::State,
    ) -> Result<Option<Innovation<T>>, StepError> {
        if prepared.count <= 1 {
            return self.0.advance_into(state, &prepared.step, reading, next);
        }
        // To and fro between two states: the last step ends in `next`.
        let mut between = state.clone();
        let mut remaining = prepared.count;
        if remaining % 2 == 1 {
            self.0.advance_into(state, &prepared.step, None, next)?;
            self.0.advance_into(next, &prepared.step, None, &mut between)?;
            remaining -= 2;
        } else {
            self.0.advance_into(state, &prepared.step, None, &mut between)?;
            remaining -= 1;
        }
        while remaining > 1 {
            self.0.advance_into(&between, &prepared.step, None, next)?;
            self.0.advance_into(next, &prepared.step, None, &mut between)?;
            remaining -= 2;
        }
        self.0.advance_into(&between, &prepared.step, reading, next)
    }

    fn smooth_back(
        &self,
        filtered: &E::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
        next: &E::State,
    ) -> Result<Option<E::State>, StepError> {
        self.smooth_back_over(filtered, prepared, reading, next)
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST, count};

    /// As many as it takes, whatever rounding makes of a sum, and no more than there may be.
    #[test]
    fn a_long_step_is_divided_into_as_many_as_it_takes() {
        for (dt_s, expected) in
            [(0.01, 1), (0.1, 1), (0.1001, 2), (0.1 + 0.1 + 0.1, 3), (0.95, 10), (6.0, 60), (1e9, MOST)]
        {
            assert_eq!(count(dt_s, 0.1), (expected, f64::from(expected)), "{dt_s} s");
        }
        assert_eq!(count(1e9, f64::INFINITY), (1, 1.0));
    }
}
