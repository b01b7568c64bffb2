use std::fmt;
use std::str::FromStr;

/// Cross-section of the simulated sensor, mm²; at 40 g the softest material then reaches the strain at which its
/// resistance turns.
const CROSS_SECTION_MM2: f64 = 17.5;
/// Weight of one gram, N.
const NEWTON_PER_GRAM: f64 = 9.806_65e-3;

/// Material of the simulated sensor, with 1:9 carbon black.
///
/// The moduli are the makers'; the electrical parameters are *illustrative*, chosen within these ranges of published
/// findings: R/R₀ between 1.33 and 1.52 at ε = 0.3; a 290 s hold that loses about a tenth of R with time constants of a
/// few seconds and a few tens of seconds; a peak of R at ε ≈ 0.23 at 1 mm/s (Ecoflex 00-30) or ε ≈ 0.12 at 5 mm/s
/// (Ecoflex 00-50, which relaxes faster and has a lower R/R₀ beyond that peak).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Material {
    /// Ecoflex 00-30: tensile strength 1.38 MPa, 100 % modulus 0.069 MPa.
    Ecoflex0030,
    /// Ecoflex 00-50: 2.17 MPa, 0.083 MPa.
    Ecoflex0050,
    /// VytaFlex 10: 1.38 MPa, 0.21 MPa; electrically much like Ecoflex 00-30.
    Vytaflex10,
    /// Ecoflex 00-30 with less carbon black: with `mismatched`, its error under a static cubic, loop area, release peak
    /// and slow drift are within the range of public recordings of carbon black in silicone and of coated nylon.
    Representative,
}

impl Material {
    /// Materials based on published findings.
    pub const ALL: [Self; 3] = [Self::Ecoflex0030, Self::Ecoflex0050, Self::Vytaflex10];

    /// Returns its name in files and flags.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ecoflex0030 => "ecoflex-00-30",
            Self::Ecoflex0050 => "ecoflex-00-50",
            Self::Vytaflex10 => "vytaflex-10",
            Self::Representative => "representative",
        }
    }

    /// Returns the resistance at rest before the first stretch, Ω.
    #[must_use]
    pub const fn rest_resistance_ohm(self) -> f64 {
        match self {
            Self::Ecoflex0030 => 1600.0,
            Self::Representative => 3200.0,
            Self::Ecoflex0050 => 2100.0,
            Self::Vytaflex10 => 1850.0,
        }
    }

    /// Returns the stress at 100 % strain, MPa.
    #[must_use]
    pub const fn modulus_100_mpa(self) -> f64 {
        match self {
            Self::Ecoflex0030 | Self::Representative => 0.069,
            Self::Ecoflex0050 => 0.083,
            Self::Vytaflex10 => 0.21,
        }
    }

    /// Returns the load that holds the sensor at a strain above -1, g.
    ///
    /// Neo-Hookean solid, engineering stress `μ (λ - λ⁻²)` with λ = 1 + ε and μ from the 100 % modulus (Treloar, *The
    /// Physics of Rubber Elasticity*), times the sensor's cross-section.
    #[must_use]
    pub fn load_g(self, strain: f64) -> f64 {
        let shear_mpa = self.modulus_100_mpa() / (2.0 - 0.25);
        let stretch = 1.0 + strain;
        shear_mpa * (stretch - stretch.powi(-2)) * CROSS_SECTION_MM2 / NEWTON_PER_GRAM
    }

    /// Returns the strain under a load of `load_g ≥ 0` grams: the inverse of [`load_g`](Self::load_g).
    #[must_use]
    pub fn strain_under_load(self, load_g: f64) -> f64 {
        // The load grows by at least μ per unit of stretch, so Newton's method from above converges monotonically.
        let per_stretch = self.modulus_100_mpa() / 1.75 * CROSS_SECTION_MM2 / NEWTON_PER_GRAM;
        let target = load_g / per_stretch;
        let mut stretch = 1.0 + target;
        for _ in 0..50 {
            let miss = stretch - stretch.powi(-2) - target;
            stretch -= miss / (1.0 + 2.0 * stretch.powi(-3));
        }
        stretch - 1.0
    }
}

impl fmt::Display for Material {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// Error for a name that is not a simulated material's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no material `{0}`: expected ecoflex-00-30, ecoflex-00-50, vytaflex-10 or representative")]
pub struct UnknownMaterial(String);

impl FromStr for Material {
    type Err = UnknownMaterial;

    fn from_str(name: &str) -> Result<Self, UnknownMaterial> {
        let mut known = Self::ALL.into_iter().chain([Self::Representative]);
        known.find(|material| material.name() == name).ok_or_else(|| UnknownMaterial(name.to_owned()))
    }
}
