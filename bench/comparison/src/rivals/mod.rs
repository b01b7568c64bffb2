mod adskalman;
mod kfilter;
mod minikalman;
mod nalgebra_straight;
mod nonlinear;
mod typed_kalman;

use ohmstrain_bench_filters::{LinearModel, STEPS, Visitor, readings};

pub use self::adskalman::smoother as adskalman_smoother;
pub use self::nonlinear::every_nonlinear_rival;
pub use self::typed_kalman::smoother as typed_kalman_smoother;

/// Passes every other filter to the visitor, with the same readings as our filters of three states.
pub fn every_rival(model: &LinearModel, visitor: &mut impl Visitor) {
    let readings = readings::<1>(STEPS);
    visitor.visit("nalgebra_3", &readings, nalgebra_straight::Straight::new(model));
    visitor.visit("adskalman_3", &readings, adskalman::Adskalman::new(model));
    visitor.visit("typed_kalman_3", &readings, typed_kalman::Linear::new(model));
    visitor.visit("kfilter_3", &readings, kfilter::Linear::new(model));
    visitor.visit("minikalman_3", &readings, minikalman::Minikalman::new(model));
    visitor.visit("typed_kalman_ukf_3", &readings, typed_kalman::Unscented::new(model));
    visitor.visit("kfilter_ukf_3", &readings, kfilter::Unscented::new(model));
}
