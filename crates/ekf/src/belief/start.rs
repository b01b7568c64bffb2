use ohmstrain_model::{Scalar, SwitchedModel};

use super::Belief;

/// Model of a sensor that determines a filter's state: `N` and `L` follow from the model and need not be specified.
///
/// For up to four branches, with a baseline ([`WithBaseline`](ohmstrain_model::WithBaseline)) and without.
///
/// ```
/// use ohmstrain_ekf::{BeliefOf, Ekf, Start};
/// use ohmstrain_model::WithBaseline;
///
/// type Sensor = WithBaseline<f32, 1>;
///
/// struct Firmware {
///     ekf: Ekf<Sensor>,
///     belief: BeliefOf<Sensor>,
/// }
///
/// fn start(sensor: Sensor) -> Firmware {
///     Firmware { ekf: Ekf::new(sensor), belief: sensor.start() }
/// }
/// assert_eq!(size_of::<BeliefOf<Sensor>>(), (4 + 10) * size_of::<f32>());
/// ```
pub trait Start {
    /// Belief about the model's state.
    type Belief;

    /// Returns the belief before any reading: [`Belief::initial`].
    #[must_use]
    fn start(&self) -> Self::Belief;
}

/// Belief of a filter for model `M`.
pub type BeliefOf<M> = <M as Start>::Belief;

macro_rules! start {
    ($($branches:literal: $states:literal, $packed:literal);+) => {$(
        impl<T: Scalar> Start for SwitchedModel<T, $branches, $states> {
            type Belief = Belief<T, $states, $packed>;

            fn start(&self) -> Self::Belief {
                Belief::initial(self)
            }
        }
    )+};
}

start!(0: 2, 3; 0: 3, 6; 1: 3, 6; 1: 4, 10; 2: 4, 10; 2: 5, 15; 3: 5, 15; 3: 6, 21; 4: 6, 21; 4: 7, 28);
