use ohmstrain_ekf::{
    Belief, Compact, Dwell, Ekf, Estimator, Evidence, Hypotheses, Imm, Mixture, PhaseMixture, Reading, SignSplit, State,
};
use ohmstrain_model::{Phase, SwitchedModel};

use crate::mixtures::GatedMixture;
use crate::readings::GATE;
use crate::{
    DT_S, Filter, GatedSparse, GatedUnscented, NonlinearReference, PackedReference, RANGE, Visitor, linearised,
    phased_sensor, readings, sensor,
};

/// Number of readings: two periods, so that they can be repeated.
pub const STEPS: usize = 1000;

/// An estimator with a gate on the normalised innovation squared and a log-likelihood.
#[derive(Clone, Copy, Debug)]
pub struct Gated<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    estimator: E,
    prepared: E::Prepared,
    state: E::State,
    log_likelihood: f64,
}

impl<E: Estimator<f64, N, L>, const N: usize, const L: usize> Gated<E, N, L> {
    /// Starts from a state before any reading.
    pub fn new(estimator: E, state: E::State) -> Self {
        Self { prepared: estimator.prepare(DT_S), estimator, state, log_likelihood: 0.0 }
    }
}

impl<E: Estimator<f64, N, L>, const N: usize, const L: usize> Filter for Gated<E, N, L> {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let Ok(taken) = self.estimator.advance(&self.state, &self.prepared, Some(Reading::from(reading))) else {
            return false;
        };
        match taken.innovation {
            Some(innovation) if innovation.nis <= GATE => {
                self.log_likelihood += innovation.log_likelihood;
                self.state = taken.state;
                true
            }
            _ => match self.estimator.advance(&self.state, &self.prepared, None) {
                Ok(predicted) => {
                    self.state = predicted.state;
                    true
                }
                Err(_) => false,
            },
        }
    }

    fn strain(&self) -> f64 {
        self.state.moments().mean[0]
    }
}

/// The generic EKF from the model's long-run distribution.
#[must_use]
pub fn ekf<const B: usize, const N: usize, const L: usize>(
    model: SwitchedModel<f64, B, N>,
) -> Gated<Ekf<SwitchedModel<f64, B, N>>, N, L> {
    Gated::new(Ekf::new(model), Belief::initial(&model))
}

/// Passes every filter to the visitor, with a thousand readings of its sensor; that is [`sensor`], except for `reference_3`.
///
/// # Panics
/// Never: the parameters are valid.
pub fn every_filter(visitor: &mut impl Visitor) {
    let readings = readings::<1>(STEPS);
    let three = sensor::<1, 3>();
    visitor.visit("reference_3", &readings, PackedReference::new(&linearised()));
    visitor.visit("nonlinear_reference_3", &readings, NonlinearReference::new());
    visitor.visit("sparse_ekf_3", &readings, GatedSparse::<1, 3, 6, Compact>::new(three));
    visitor.visit("sparse_ekf_4", &readings, GatedSparse::<1, 4, 10, Compact>::new(sensor()));
    visitor.visit("sparse_ukf_3", &readings, GatedUnscented::<1, 3, 6>::new(three));
    visitor.visit("ekf_3", &readings, ekf::<1, 3, 6>(three));
    visitor.visit("ekf_4", &readings, ekf::<1, 4, 10>(sensor()));
    every_large_filter(visitor);
}

/// Passes the filters of six states: strain, rate, three branches, baseline.
fn every_large_filter(visitor: &mut impl Visitor) {
    let readings = readings::<3>(STEPS);
    let (six, phased) = (sensor::<3, 6>(), phased_sensor::<3, 6>());
    visitor.visit("sparse_ekf_6", &readings, GatedSparse::<3, 6, 21, Compact>::new(six));
    visitor.visit("ekf_6", &readings, ekf::<3, 6, 21>(six));
    let evidence = Evidence { limits: RANGE, tempering: 1.0 };
    let dwell = Dwell::new(0.7, 1.5, 0.3).expect("the durations are valid");
    let start = Belief::<f64, 6, 21>::initial(&six);
    let imm = Imm::new(phased, DT_S, dwell, evidence).expect("the step's length is positive");
    visitor.visit("imm_6", &readings, GatedMixture::new(imm, PhaseMixture::single(start, Phase::Hold)));
    let split = SignSplit::<_, 3, 6, 8>::new(six, DT_S, Some(dwell), evidence);
    let split = split.expect("the step's length is positive");
    visitor.visit("sign_split_6", &readings, GatedMixture::new(split, Mixture::single(start, Phase::Hold)));
    let best = Hypotheses::<_, 3, 6, 8>::new(phased, DT_S, dwell, evidence).expect("the step's length is positive");
    let start_of_best = Mixture::single(start, Phase::Hold);
    visitor.visit("hypotheses_6", &readings, GatedMixture::new(best, start_of_best));
}
