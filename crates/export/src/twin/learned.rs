//! The learned correction of the exported program, in any precision.

use ohmstrain_ekf::Real;
use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};
use ohmstrain_ekf::live::Learned;
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::PortableCorrection;
use ohmstrain_sensor::correction::OwnedCorrection;

use crate::quadratic::OwnedQuadratic;

/// A correction, and the quadratic functions that replace rows left out.
pub struct OwnedLearned<T: Real> {
    features: FeatureScale<T>,
    rows: OwnedCorrection<T, FILTER_INPUTS>,
    /// Quadratics of the direct process and of the residual one.
    quadratics: Option<[OwnedQuadratic<T>; 2]>,
}

impl<T: Real> OwnedLearned<T> {
    /// Converts a correction to the precision of the program, with its limits.
    pub fn new(
        correction: &PortableCorrection,
        quadratics: Option<&[OwnedQuadratic; 2]>,
        limits: StrainRange<T>,
    ) -> Self {
        let features = correction.features.to();
        let rows = OwnedCorrection { limits, ..correction.learned.map(T::of) };
        Self { features, rows, quadratics: quadratics.map(|both| both.each_ref().map(|one| one.map(T::of))) }
    }

    /// Borrows it in the form that a live filter takes.
    pub fn learned(&self) -> (FeatureScale<T>, Learned<'_, T>) {
        let quadratics = self.quadratics.as_ref().map(|both| both.each_ref().map(OwnedQuadratic::borrowed));
        (self.features, Learned { correction: self.rows.correction(), quadratics })
    }
}
