use ohmstrain_model::{Phase, Turning};
use std::vec::Vec;

use super::expression::standing_for;
use super::{Expression, Recorded, Tape};
use crate::kernel::{Course, Lanes, Parts, RateSpread};
use crate::{Compact, Curve, Reading, SparseEkf};

/// A part of a step that goes from one end to the other without asking which way.
///
/// The first inputs are the state's means, then the lower triangle of its covariance row by row, then two more (what
/// they are stands with each), then what depends on the length of the step ([`SparseEkf::step_names`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// The prediction of a hypothesis: out comes the state.
    Predict(Phase),
    /// The same where the rate may have turned around on the way, which adds an excess (input) of path with a variance
    /// (input).
    PredictTurning(Phase),
    /// The prediction with an uncertain direction.
    PredictOpen,
    /// The update with a reading (input) that has so much extra variance (input): out come the state, the innovation, its
    /// variance, the normalised innovation squared, and whether all of it is sound. With no phase the rate is split.
    Take(Option<Phase>),
    /// Whether a state is sound. It stays.
    Sound,
    /// The rate moves by its variance times an input, which the other states follow; its variance changes by its square
    /// times another. Out comes the state.
    Regress,
    /// The rate that a moving phase leads to: its mean and variance.
    RateAhead(Phase),
    /// How a rate of a phase's sign changes: the expected change away from zero, and its variance from what is not known.
    RateChange(Phase),
}

/// The sizes of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// Number of means.
    pub means: usize,
    /// Number of entries of the covariance.
    pub covariances: usize,
}

impl<const B: usize, const N: usize, G: Curve<f32>> SparseEkf<f32, Compact, B, N, G> {
    /// The sizes of a state.
    #[must_use]
    pub const fn carried() -> Carried {
        Carried { means: N, covariances: N * (N + 1) / 2 }
    }

    /// Writes down what the filter does, with the numbers of this sensor as constants.
    #[must_use]
    pub fn record(&self, piece: Piece) -> Recorded {
        let Carried { means, covariances } = Self::carried();
        let state = means + covariances;
        let (mut open, mut input) = (*self, state + 2);
        open.step.visit(&mut |_, _, number| {
            *number = standing_for(input);
            input += 1;
        });
        open.write_down(piece)
    }

    /// With a step of numbers that stand for inputs.
    fn write_down(&self, piece: Piece) -> Recorded {
        let tape = Tape::default();
        let Carried { means, covariances } = Self::carried();
        let state = means + covariances;
        let inputs: Vec<_> = (0..state + 2).map(|number| tape.input(number)).collect();
        let (mean, rest) = inputs.split_at(means);
        let (covariance, more) = rest.split_at(covariances);
        let (first, second) = (more[0], more[1]);
        let mut parts = Parts::read::<N>(&mut mean.iter(), &mut covariance.iter(), first.literal(0.0));
        let spread = RateSpread::<_, Compact>::new(parts.rate_variance);
        match piece {
            Piece::Predict(phase) => drop(self.predict(&mut parts, Course::Known(phase))),
            Piece::PredictTurning(phase) => {
                let turning = Turning { excess: first, variance: second };
                self.predict(&mut parts, Course::Within(phase, turning));
            }
            Piece::PredictOpen => drop(self.predict(&mut parts, Course::Uncertain)),
            Piece::Regress => parts.regress::<N>(first, second),
            Piece::Sound => {
                let sound = parts.is_sound::<N>(parts.variances::<N>());
                return tape.recorded([sound]);
            }
            Piece::Take(phase) => {
                let reading = Reading { value: first, extra_variance: second };
                let compared = self.compare(&parts, reading, phase, spread);
                let present = first.literal(0.0).less(first.literal(1.0));
                let nis = Self::correct(&mut parts, &compared, present);
                let sound = parts.is_sound::<N>(compared.variance + nis);
                let results = [compared.innovation, compared.variance, nis, sound];
                return tape.recorded(Self::written(&parts, first).into_iter().chain(results));
            }
            Piece::RateAhead(phase) => {
                let ahead = self.rate_ahead(phase, &parts);
                return tape.recorded([ahead.mean, ahead.variance]);
            }
            Piece::RateChange(phase) => {
                let change = self.rate_change(phase, &parts);
                return tape.recorded([change.expected, change.spread]);
            }
        }
        tape.recorded(Self::written(&parts, first))
    }

    fn written<'a>(parts: &Parts<Expression<'a>, B>, like: Expression<'a>) -> Vec<Expression<'a>> {
        let Carried { means, covariances } = Self::carried();
        let mut written = std::vec![like; means + covariances];
        let (mean, covariance) = written.split_at_mut(means);
        parts.write::<N>(&mut mean.iter_mut(), &mut covariance.iter_mut());
        written
    }
}
