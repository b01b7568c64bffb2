//! The other filters, with F, Q and H computed in every step by their user. They have neither a gate nor a log-likelihood.

mod adskalman;
mod kfilter;
mod nalgebra_straight;
mod typed_kalman;

use ohmstrain_bench_filters::{STEPS, Visitor, readings, sensor};
use ohmstrain_ekf::Belief;

/// Passes each of them to the visitor, with the same readings as our filters of three states.
pub fn every_nonlinear_rival(visitor: &mut impl Visitor) {
    let (readings, start) = (readings::<1>(STEPS), Belief::initial(&sensor::<1, 3>()));
    visitor.visit("nonlinear_nalgebra_3", &readings, nalgebra_straight::Straight::new(&start));
    visitor.visit("nonlinear_adskalman_3", &readings, adskalman::Adskalman::new(&start));
    visitor.visit("nonlinear_typed_kalman_3", &readings, typed_kalman::TypedKalman::new(&start));
    visitor.visit("nonlinear_kfilter_3", &readings, kfilter::Kfilter::new(&start));
}
