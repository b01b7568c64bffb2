use nalgebra::RealField;

/// The numbers everything here computes with: `f32`, `f64`, or a dual number that carries exact derivatives.
pub trait Scalar: RealField + Copy {
    /// The nearest value to a literal of the source text.
    // Inlined at any optimisation, so that a constant is converted while compiling: at run time it would call software on a
    // microcontroller without double precision.
    #[inline(always)]
    fn of(value: f64) -> Self {
        nalgebra::convert(value)
    }
}

impl<T: RealField + Copy> Scalar for T {}
