use ohmstrain_model::{Phase, Turning};
use std::vec::Vec;

use super::expression::standing_for;
use super::{Expression, Recorded, Tape};
use crate::kernel::falls::exponential;
use crate::kernel::tail::Tail;
use crate::kernel::{Course, Lanes, Parts, RateSpread};
use crate::mixture::evidence::Weighing;
use crate::mixture::pair::{About, merge};
use crate::{Compact, Curve, Gaussian, Reading, SparseEkf};

/// A part of a step without branches.
///
/// Its inputs are the state's means, the lower triangle of the covariance row by row, the piece's own inputs ([`Piece::inputs`]),
/// and the numbers that depend on the step's length ([`SparseEkf::step_names`]). A *side* is the side of zero, 1 or -1, of a moving
/// phase's rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Prediction of a hypothesis. Result: the state.
    Predict(Phase),
    /// The same if the rate may have turned around within the step, which adds an excess path (input) with a variance
    /// (input).
    PredictTurning(Phase),
    /// Prediction with an uncertain direction. Result: the state.
    PredictOpen,
    /// Update with a reading (input) and its extra variance (input). Results: the state, the innovation, its variance,
    /// the normalised innovation squared, and true if all of these are valid. Without a phase the rate is split.
    Take(Option<Phase>),
    /// Check that a state is valid; the state is unchanged.
    Sound,
    /// New rate with a mean (input) and a variance (input). Result: the state.
    Renew,
    /// Path beyond the net displacement of a rate on a side (input) that may turn around. Results: the excess, and its
    /// variance.
    Turns,
    /// True if almost none of the probability of a moving phase's prediction is on its side (input).
    Hopeless,
    /// Probability of a side (input) if no truncation is needed, and true if one is.
    CertainOfSide,
    /// The state truncated to rates on a side (input), and the remaining probability.
    CutOff,
    /// Probability of the limits times the first input, and the inverse of that probability, for a lower and an upper limit
    /// (inputs).
    OfLimits,
    /// The exponential of an exponent (input) up to zero.
    Falling,
    /// The density of a standard normal at a border (input) divided by its upper tail, and that tail.
    Tail,
    /// True if another state (inputs) is alike.
    Alike,
    /// The squared distance of another state (inputs) in strain and rate.
    Distance,
    /// The mean and covariance of the pair of this state and another one (inputs), with their shares (inputs).
    Merge,
}

impl Piece {
    /// Returns the number of inputs besides the state.
    #[must_use]
    pub const fn inputs(self, carried: Carried) -> usize {
        let another = carried.means + carried.covariances;
        match self {
            Self::Predict(_) | Self::PredictOpen | Self::Sound => 0,
            Self::Turns | Self::Hopeless | Self::CertainOfSide | Self::CutOff | Self::Falling | Self::Tail => 1,
            Self::PredictTurning(_) | Self::Take(_) | Self::Renew => 2,
            Self::OfLimits => 3,
            Self::Alike | Self::Distance => another,
            Self::Merge => another + 2,
        }
    }
}

/// The sizes of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// Number of means.
    pub means: usize,
    /// Number of entries of the covariance.
    pub covariances: usize,
}

/// Inputs of a piece besides the state, and the tape that records it.
struct Inputs<'a, 't> {
    tape: &'t Tape,
    more: &'a [Expression<'t>],
}

impl<'t> Inputs<'_, 't> {
    /// Returns the input with this index; a piece with fewer inputs does not use it.
    fn at(&self, number: usize) -> Expression<'t> {
        self.more.get(number).copied().unwrap_or_else(|| self.tape.input(0).literal(0.0))
    }
}

impl<const B: usize, const N: usize, G: Curve<f32>> SparseEkf<f32, Compact, B, N, G> {
    /// The sizes of a state.
    #[must_use]
    pub const fn carried() -> Carried {
        Carried { means: N, covariances: N * (N + 1) / 2 }
    }

    /// Records a piece of the filter, with the numbers of this sensor as constants.
    #[must_use]
    pub fn record(&self, piece: Piece) -> Recorded {
        let carried = Self::carried();
        let (mut open, mut input) = (*self, carried.means + carried.covariances + piece.inputs(carried));
        open.step.visit(&mut |_, _, number| {
            *number = standing_for(input);
            input += 1;
        });
        open.write_down(piece)
    }

    /// Records a piece with placeholders for inputs.
    fn write_down(&self, piece: Piece) -> Recorded {
        let tape = Tape::default();
        let carried = Self::carried();
        let state = carried.means + carried.covariances;
        let numbers: Vec<_> = (0..state + piece.inputs(carried)).map(|number| tape.input(number)).collect();
        let (own, more) = numbers.split_at(state);
        let (mut parts, inputs) = (Self::state_of(own), Inputs { tape: &tape, more });
        let results = self.results_of(piece, &mut parts, &inputs);
        let changed = if piece.changes_state() { Self::written(&parts) } else { Vec::new() };
        tape.recorded(changed.into_iter().chain(results))
    }

    /// Computes the results of a piece besides the state, which is changed in place.
    fn results_of<'t>(
        &self,
        piece: Piece,
        parts: &mut Parts<Expression<'t>, B>,
        inputs: &Inputs<'_, 't>,
    ) -> Vec<Expression<'t>> {
        let (first, second, always) = (inputs.at(0), inputs.at(1), inputs.tape.known(true));
        let mut results = Vec::new();
        match piece {
            Piece::Predict(phase) => drop(self.predict::<_, Compact>(parts, Course::Known(phase))),
            Piece::PredictTurning(phase) => {
                let turning = Turning { excess: first, variance: second };
                self.predict::<_, Compact>(parts, Course::Within(phase, turning));
            }
            Piece::PredictOpen => drop(self.predict::<_, Compact>(parts, Course::Uncertain)),
            Piece::Take(phase) => {
                let spread = RateSpread::<_, Compact>::new(parts.rate_variance);
                let reading = Reading { value: first, extra_variance: second };
                let compared = self.compare(parts, reading, phase, spread);
                let nis = Self::correct(parts, &compared, always);
                let sound = parts.is_sound::<N>(compared.variance + nis);
                results.extend([compared.innovation, compared.variance, nis, sound]);
            }
            Piece::Sound => results.push(parts.is_sound::<N>(parts.variances::<N>())),
            Piece::Renew => parts.renew_rate(Gaussian { mean: first, variance: second }, always),
            Piece::Turns => {
                let turning = self.turning::<_, Compact>(first, parts, always);
                results.extend([turning.excess, turning.variance]);
            }
            Piece::Hopeless => results.push(self.is_hopeless(first, parts)),
            Piece::CertainOfSide => results.extend(<[_; 2]>::from(parts.certain_of_side(first, clear(), always))),
            Piece::CutOff => results.push(parts.cut_off::<Compact, N>(first, always)),
            Piece::OfLimits => {
                let limits =
                    [1, 2].map(|input| standing_for(Self::carried().means + Self::carried().covariances + input));
                let weighing = Weighing::of_any_limits(limits[0], limits[1]);
                let strain = (parts.strain, parts.strain_variance);
                results.extend(weighing.of_limits::<_, Compact>(strain, first, always));
            }
            Piece::Falling => results.push(exponential(first)),
            Piece::Tail => {
                let Tail { mass, hazard } = Tail::above(first, always);
                results.extend([hazard, mass]);
            }
            Piece::Alike => results.push(About::of(parts).is_like(&About::of(&Self::state_of(inputs.more)))),
            Piece::Distance => results.push(About::of(parts).distance(&About::of(&Self::state_of(inputs.more)))),
            Piece::Merge => {
                let (mut pair, others) = (Self::written(parts), Self::written(&Self::state_of(inputs.more)));
                let (mean, covariance) = pair.split_at_mut(N);
                let shares = [inputs.at(others.len()), inputs.at(others.len() + 1)];
                let other_mean: &[_; N] = &core::array::from_fn(|i| inputs.at(i));
                merge((mean.iter_mut(), covariance.iter_mut()), (other_mean, others[N..].iter()), shares);
                *parts = Self::state_of(&pair);
            }
        }
        results
    }

    /// Returns the state from the first numbers of a list.
    fn state_of<'t>(numbers: &[Expression<'t>]) -> Parts<Expression<'t>, B> {
        let (mean, covariance) = numbers.split_at(Self::carried().means);
        Parts::read::<N>(&mut mean.iter(), &mut covariance.iter(), mean[0].literal(0.0))
    }

    fn written<'t>(parts: &Parts<Expression<'t>, B>) -> Vec<Expression<'t>> {
        let Carried { means, covariances } = Self::carried();
        let mut written = std::vec![parts.strain; means + covariances];
        let (mean, covariance) = written.split_at_mut(means);
        parts.write::<N>(&mut mean.iter_mut(), &mut covariance.iter_mut());
        written
    }
}

/// Returns the squared number of standard deviations beyond which a tail does not count, in single precision.
fn clear() -> f32 {
    Weighing::of_any_limits(0.0, 0.0).clear()
}

impl Piece {
    /// True if the state is among the results.
    #[must_use]
    pub const fn changes_state(self) -> bool {
        matches!(
            self,
            Self::Predict(_)
                | Self::PredictTurning(_)
                | Self::PredictOpen
                | Self::Take(_)
                | Self::Renew
                | Self::CutOff
                | Self::Merge
        )
    }
}
