use ohmstrain_model::Phase;

/// A short movement at constant rate.
pub(super) struct Movement {
    pub from_strain: f64,
    pub to_strain: f64,
    /// Strain rate, 1/s.
    pub rate: f64,
    pub duration_s: f64,
}

impl Movement {
    pub(super) fn phase(&self) -> Phase {
        match self.rate {
            rate if rate > 0.0 => Phase::Extend,
            rate if rate < 0.0 => Phase::Retract,
            _ => Phase::Hold,
        }
    }

    pub(super) fn mid_strain(&self) -> f64 {
        f64::midpoint(self.from_strain, self.to_strain)
    }
}

/// Sensor that the bench stretches.
pub(super) trait StretchedSensor {
    /// Moves the sensor through a movement.
    fn advance(&mut self, movement: &Movement);

    /// Returns R/R₀ - 1 at the end of `movement`, the last one.
    fn relative_change(&self, movement: &Movement) -> f64;
}
