use crate::Scalar;
use crate::error::{ParameterError, Problem};

/// Reading in ohms, with its standard deviation due to the electronics.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ohms<T> {
    /// Resistance, Ω.
    pub resistance_ohm: T,
    /// Standard deviation from quantisation and converter noise, Ω.
    pub sd_ohm: T,
}

/// Result of an analogue-to-digital conversion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AdcCode<T> {
    /// A usable reading.
    Reading(Ohms<T>),
    /// The code is at an end of the scale; the resistance may lie beyond.
    Saturated,
}

/// Position of the sensor in a voltage divider.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorSide {
    /// Between the output and ground.
    Low,
    /// Between the supply and the output.
    High,
}

/// A voltage divider read by a ratiometric converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Divider<T> {
    reference_ohm: T,
    side: SensorSide,
    converter: Converter<T>,
}

/// Constant current through the sensor; the voltage across it is amplified and converted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantCurrent<T> {
    ohm_per_code: T,
    converter: Converter<T>,
}

/// The electronics between sensor and number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrontEnd<T> {
    /// Voltage divider.
    Divider(Divider<T>),
    /// Constant current.
    ConstantCurrent(ConstantCurrent<T>),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Converter<T> {
    full_scale: u32,
    code_sd: T,
}

/// Converts a code to a number, through `f32`, which holds 24 bits exactly. Through `f64`, a microcontroller without double
/// precision would need software arithmetic for every reading.
fn count<T: Scalar>(code: u32) -> T {
    nalgebra::convert(code as f32)
}

impl<T: Scalar> Converter<T> {
    /// `noise_codes`: standard deviation of the converter's own noise; rounding to a code adds 1/12 to its square.
    fn new(bits: u32, noise_codes: T) -> Result<Self, ParameterError> {
        if !(1..=24).contains(&bits) {
            return Err(ParameterError::new("bits", Problem::OutOfRange));
        }
        if !(noise_codes.is_finite() && noise_codes >= T::zero()) {
            return Err(ParameterError::new("noise_codes", Problem::Negative));
        }
        let variance = noise_codes * noise_codes + T::of(1.0 / 12.0);
        Ok(Self { full_scale: (1 << bits) - 1, code_sd: variance.sqrt() })
    }

    fn is_saturated(&self, code: u32) -> bool {
        code == 0 || code >= self.full_scale
    }
}

impl<T: Scalar> Divider<T> {
    /// - `reference_ohm`: the known resistor, Ω.
    /// - `bits`: resolution of the converter, 1 to 24; code 2^bits - 1 is the supply.
    /// - `noise_codes`: standard deviation of the converter's noise, in codes.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn new(reference_ohm: T, side: SensorSide, bits: u32, noise_codes: T) -> Result<Self, ParameterError> {
        if !(reference_ohm.is_finite() && reference_ohm > T::zero()) {
            return Err(ParameterError::new("reference_ohm", Problem::NotPositive));
        }
        Ok(Self { reference_ohm, side, converter: Converter::new(bits, noise_codes)? })
    }

    /// Returns the resistance of a code, Ω: `R = R_ref x/(1-x)` on the low side, `R_ref (1-x)/x` on the high side, with
    /// x the code over full scale.
    #[must_use]
    pub fn read(&self, code: u32) -> AdcCode<T> {
        if self.converter.is_saturated(code) {
            return AdcCode::Saturated;
        }
        let full_scale = count(self.converter.full_scale);
        let x = count::<T>(code) / full_scale;
        let rest = T::one() - x;
        let (ratio, slope) = match self.side {
            SensorSide::Low => (x / rest, T::one() / (rest * rest)),
            SensorSide::High => (rest / x, T::one() / (x * x)),
        };
        AdcCode::Reading(Ohms {
            resistance_ohm: self.reference_ohm * ratio,
            sd_ohm: self.reference_ohm * slope * self.converter.code_sd / full_scale,
        })
    }

    /// Returns the unrounded code of a resistance.
    #[must_use]
    pub fn code(&self, resistance_ohm: T) -> T {
        let share = resistance_ohm / (resistance_ohm + self.reference_ohm);
        let x = if self.side == SensorSide::Low { share } else { T::one() - share };
        x * count::<T>(self.converter.full_scale)
    }
}

impl<T: Scalar> ConstantCurrent<T> {
    /// - `current_a`: current through the sensor, A; `gain`: amplification of its voltage.
    /// - `full_scale_v`: voltage of code 2^bits - 1; `noise_codes` as for a divider.
    ///
    /// # Errors
    /// Names the parameter that is not positive.
    pub fn new(current_a: T, gain: T, full_scale_v: T, bits: u32, noise_codes: T) -> Result<Self, ParameterError> {
        for (name, value) in [("current_a", current_a), ("gain", gain), ("full_scale_v", full_scale_v)] {
            if !(value.is_finite() && value > T::zero()) {
                return Err(ParameterError::new(name, Problem::NotPositive));
            }
        }
        let converter = Converter::new(bits, noise_codes)?;
        let volts_per_code = full_scale_v / count(converter.full_scale);
        Ok(Self { ohm_per_code: volts_per_code / (current_a * gain), converter })
    }

    /// Returns the resistance of a code, Ω.
    #[must_use]
    pub fn read(&self, code: u32) -> AdcCode<T> {
        if self.converter.is_saturated(code) {
            return AdcCode::Saturated;
        }
        AdcCode::Reading(Ohms {
            resistance_ohm: self.ohm_per_code * count::<T>(code),
            sd_ohm: self.ohm_per_code * self.converter.code_sd,
        })
    }

    /// Returns the unrounded code of a resistance.
    #[must_use]
    pub fn code(&self, resistance_ohm: T) -> T {
        resistance_ohm / self.ohm_per_code
    }
}

impl<T: Scalar> FrontEnd<T> {
    /// Returns the resistance of a code, Ω.
    #[must_use]
    pub fn read(&self, code: u32) -> AdcCode<T> {
        match self {
            Self::Divider(divider) => divider.read(code),
            Self::ConstantCurrent(source) => source.read(code),
        }
    }

    /// Returns the unrounded code of a resistance.
    #[must_use]
    pub fn code(&self, resistance_ohm: T) -> T {
        match self {
            Self::Divider(divider) => divider.code(resistance_ohm),
            Self::ConstantCurrent(source) => source.code(resistance_ohm),
        }
    }
}
