/// No narrowing: an easy recording is no promise for the next one. A factor beyond the upper end says that something else
/// is wrong.
const SCALES: std::ops::RangeInclusive<f64> = 1.0..=5.0;
/// Half-width of the 95 % interval of a standard normal.
const Z_95: f64 = 1.959_963_984_540_054;

/// What the standard deviations are multiplied with so that 95 % of the errors of the worst block lie in the 95 %
/// interval, from the errors of each block in units of their deviations: split conformal prediction (Papadopoulos et
/// al., *ECML* 2002) with the blocks left out.
///
/// Errors are correlated over seconds, blocks are as good as independent: one more of them is worse than the worst of
/// four with a probability of 1/5, while half of them are worse than what covers all rows together.
pub(crate) fn sd_scale(blocks: &[Vec<f64>]) -> f64 {
    let worst = blocks.iter().filter_map(|block| quantile_95(block.clone())).reduce(f64::max);
    worst.map_or(1.0, |deviation| (deviation / Z_95).clamp(*SCALES.start(), *SCALES.end()))
}

fn quantile_95(mut deviations: Vec<f64>) -> Option<f64> {
    deviations.sort_by(f64::total_cmp);
    let rank = (deviations.len().saturating_sub(1) * 95).div_ceil(100);
    deviations.get(rank).copied()
}

#[cfg(test)]
mod tests {
    use super::{Z_95, sd_scale};

    /// Deviations 1/100, 2/100, … 1 in units of `factor` interval widths: the 95 % quantile is 0.95 of them.
    fn deviations(factor: f64) -> Vec<Vec<f64>> {
        vec![(1..=100).rev().map(|k| factor * Z_95 * f64::from(k) / 95.0).collect()]
    }

    #[test]
    fn the_worst_block_counts() {
        let blocks = [deviations(0.5), deviations(2.0), deviations(1.0)].concat();
        assert_eq!(sd_scale(&blocks), sd_scale(&deviations(2.0)));
    }

    #[test]
    fn the_interval_is_widened_and_never_narrowed() {
        assert!((sd_scale(&deviations(2.0)) - 2.0 * 96.0 / 95.0).abs() < 1e-12);
        assert_eq!((sd_scale(&deviations(100.0)), sd_scale(&deviations(0.5))), (5.0, 1.0));
        assert_eq!(sd_scale(&[]), 1.0);
    }
}
