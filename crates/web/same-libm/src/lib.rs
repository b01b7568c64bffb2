//! Elementary functions under the names of C's, from the crate that Rust's WebAssembly has them from. A program that loads this
//! before the system's (`LD_PRELOAD`) computes them as WebAssembly does: the system's differ in the last bit now and then.

macro_rules! of_one {
    ($($number:ty: $($name:ident)*;)*) => { $($(
        /// Implementation of the function of that name.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(x: $number) -> $number {
            libm::$name(x)
        }
    )*)* };
}

macro_rules! of_two {
    ($($number:ty: $($name:ident)*;)*) => { $($(
        /// Implementation of the function of that name.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(x: $number, y: $number) -> $number {
            libm::$name(x, y)
        }
    )*)* };
}

of_one! {
    f64: exp exp2 expm1 log log10 log1p log2 sin cos tan asin acos atan sinh cosh tanh cbrt;
    f32: expf exp2f expm1f logf log10f log1pf log2f sinf cosf tanf asinf acosf atanf sinhf coshf tanhf cbrtf;
}

of_two! {
    f64: pow atan2 hypot;
    f32: powf atan2f hypotf;
}

/// Sine and cosine at once, as compilers ask for where both are wanted.
///
/// # Safety
/// Both places can be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sincos(x: f64, sine: *mut f64, cosine: *mut f64) {
    let both = libm::sincos(x);
    // SAFETY: the caller says so.
    unsafe { (*sine, *cosine) = both }
}
