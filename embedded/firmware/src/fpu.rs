//! Square root by the floating-point unit, which Rust's `core` does not offer on stable.

use ohmstrain_ekf::{Compact, CompactWidth, Switch};
use ohmstrain_model::SplitRate;

/// [`Compact`] with square roots by `vsqrt`: a few instructions instead of a routine with a table. Both round correctly, so the
/// results are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnFpu;

impl Switch<f32> for OnFpu {
    const CLEAR: f64 = <Compact as Switch<f32>>::CLEAR;

    type Width = CompactWidth<f32>;

    #[inline(always)]
    fn width(rate_variance: f32) -> CompactWidth<f32> {
        CompactWidth::new(rate_variance, root)
    }

    #[inline]
    fn blend(rate: f32, width: CompactWidth<f32>) -> SplitRate<f32> {
        Compact::blend(rate, width)
    }

    #[inline(always)]
    fn root(square: f32) -> f32 {
        root(square)
    }
}

/// Reference on the host.
impl Switch<f64> for OnFpu {
    const CLEAR: f64 = <Compact as Switch<f64>>::CLEAR;

    type Width = CompactWidth<f64>;

    fn width(rate_variance: f64) -> CompactWidth<f64> {
        Compact::width(rate_variance)
    }

    fn blend(rate: f64, width: CompactWidth<f64>) -> SplitRate<f64> {
        Compact::blend(rate, width)
    }
}

#[cfg(target_os = "none")]
#[inline(always)]
fn root(square: f32) -> f32 {
    let mut bits = square.to_bits();
    // SAFETY: leaves every register and the stack as they were, except `bits`. Stable Rust cannot name a register of the unit,
    // so one is saved and restored.
    unsafe {
        core::arch::asm!(
            "vpush {{s0}}",
            "vmov s0, {bits}",
            "vsqrt.f32 s0, s0",
            "vmov {bits}, s0",
            "vpop {{s0}}",
            bits = inout(reg) bits,
            options(pure, nomem, preserves_flags),
        );
    }
    f32::from_bits(bits)
}

#[cfg(not(target_os = "none"))]
fn root(square: f32) -> f32 {
    nalgebra::ComplexField::sqrt(square)
}
