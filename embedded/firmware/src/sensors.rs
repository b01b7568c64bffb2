//! The sensor of all filters here, and the electronics in front of it. Their numbers are illustrative.

use ohmstrain_ekf::Reading;
use ohmstrain_model::{
    AdcCode, Branch, Divider, Gauge, ModelNoise, Motion, ParameterError, Scalar, SensorLaw, SensorSide, StrainRange,
    SwitchedModel,
};

/// Time between readings, s.
pub const DT_S: f64 = 0.01;

/// Resistance at rest, Ω.
pub const REST_OHM: f64 = 5500.0;

/// Returns the range of strains for which the law holds.
#[must_use]
pub fn limits<T: Scalar>() -> StrainRange<T> {
    StrainRange { lower: T::of(-0.02), upper: T::of(0.35) }
}

/// Returns a sensor with up to three branches that share the relaxation, and a baseline if `N = B + 3`.
///
/// # Errors
/// None: the parameters are valid.
pub fn sensor<T: Scalar, const B: usize, const N: usize>() -> Result<SwitchedModel<T, B, N>, ParameterError> {
    let share = |gain: f64| T::of(gain / B as f64);
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [T::of(1.6), T::of(-1.2), T::of(0.5)] },
        extend_viscosity_s: T::of(0.02),
        retract_viscosity_s: T::of(-0.01),
        branches: core::array::from_fn(|i| Branch {
            tau_s: match i {
                0 => T::of(4.0),
                1 => T::of(32.0),
                _ => T::of(256.0),
            },
            extend_gain: share(0.8),
            retract_gain: share(-0.5),
            extend_gain_slope: share(-0.6),
            retract_gain_slope: share(-0.4),
        }),
        range: limits(),
    };
    let noise = ModelNoise {
        reading_sd: T::of(2e-3),
        branch_sd: T::of(5e-3),
        baseline_sd: if N == B + 3 { T::of(0.02) } else { T::zero() },
        baseline_time_s: T::of(30.0),
    };
    let motion = Motion::ornstein_uhlenbeck(T::of(1.5), T::of(0.06), T::of(0.07), T::of(0.06))?;
    SwitchedModel::new(law, motion, noise)
}

/// Returns a 12-bit divider with 10 kΩ above the sensor and noise of one code.
///
/// # Errors
/// None: the parameters are valid.
pub fn front_end<T: Scalar>() -> Result<Divider<T>, ParameterError> {
    Divider::new(T::of(10_000.0), SensorSide::Low, 12, T::one())
}

/// Converts a converter code to R/R₀ - 1; `None` at the ends of the scale.
#[inline(never)]
pub fn to_reading<T: Scalar>(divider: &Divider<T>, code: u32) -> Option<Reading<T>> {
    match divider.read(code) {
        AdcCode::Saturated => None,
        AdcCode::Reading(ohms) => {
            let per_ohm = T::of(1.0 / REST_OHM);
            let sd = ohms.sd_ohm * per_ohm;
            Some(Reading { value: ohms.resistance_ohm * per_ohm - T::one(), extra_variance: sd * sd })
        }
    }
}
