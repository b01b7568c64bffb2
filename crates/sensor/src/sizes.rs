/// Runs code for a law with B branches, whose filters have N = B + 3 states and covariances of L = N (N + 1)/2 entries; `None`
/// for more than four branches.
#[macro_export]
macro_rules! with_sizes {
    ($branches:expr, $B:ident, $N:ident, $L:ident => $run:expr) => {
        $crate::with_sizes!(@ $branches, $B, $N, $L, $run, 0 1 2 3 4)
    };
    (@ $branches:expr, $B:ident, $N:ident, $L:ident, $run:expr, $($count:literal)+) => {
        match $branches {
            $($count => {
                const $B: usize = $count;
                const $N: usize = $B + 3;
                const $L: usize = $N * ($N + 1) / 2;
                Some($run)
            })+
            _ => None,
        }
    };
}
