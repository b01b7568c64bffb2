//! Regressions for the law of the sensor, and the information of recordings on its parameters.

pub(crate) mod advice;
pub(crate) mod blocked_normal;
pub(crate) mod bootstrap;
pub(crate) mod compare;
pub(crate) mod design;
pub(crate) mod fit;
pub(crate) mod identifiability;
pub(crate) mod least_squares;
pub(crate) mod regression;
pub(crate) mod robust_loss;
pub(crate) mod structure;
pub(crate) mod uncertainty;
