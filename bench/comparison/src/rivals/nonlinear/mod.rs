//! The others with F, Q and H worked out in every step, which is for their user to do. They have neither gate nor
//! log-likelihood.

mod adskalman;
mod kfilter;
mod nalgebra_straight;
mod typed_kalman;

use ohmstrain_bench_filters::{STEPS, Visitor, readings, sensor};
use ohmstrain_ekf::Belief;

/// Shows each of them, with the readings that ours of three states get.
pub fn every_nonlinear_rival(visitor: &mut impl Visitor) {
    let (readings, start) = (readings::<1>(STEPS), Belief::initial(&sensor::<1, 3>()));
    visitor.visit("nonlinear_nalgebra_3", &readings, nalgebra_straight::Straight::new(&start));
    visitor.visit("nonlinear_adskalman_3", &readings, adskalman::Adskalman::new(&start));
    visitor.visit("nonlinear_typed_kalman_3", &readings, typed_kalman::TypedKalman::new(&start));
    visitor.visit("nonlinear_kfilter_3", &readings, kfilter::Kfilter::new(&start));
}
