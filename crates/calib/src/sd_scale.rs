use crate::order::sorted;
use ohmstrain_sensor::LARGEST_SD_SCALE;

/// Range of the factor. It never narrows, because an easy recording does not predict the next one.
const SCALES: std::ops::RangeInclusive<f64> = 1.0..=LARGEST_SD_SCALE;
/// Range of the joint factor: intervals that were widened to cover the worst block may be narrowed to cover all of them together.
const JOINT_SCALES: std::ops::RangeInclusive<f64> = 0.35..=3.0;
/// Number of iterations that find a factor.
const TURNS: usize = 6;
/// Half-widths of the 50, 90 and 95 % intervals of a standard normal.
const LEVELS: [(usize, f64); 3] = [(50, 0.674_489_750_196_081_7), (90, 1.644_853_626_951_472_2), (95, Z_95)];
/// Half-width of the 95 % interval of a standard normal.
pub(crate) const Z_95: f64 = 1.959_963_984_540_054;

/// Returns the factor on the standard deviations with which the 95 % interval covers 95 % of the errors of the worst block, given the
/// errors of each block in units of their deviations: split conformal prediction (Papadopoulos et al., *ECML* 2002) with held-out blocks.
///
/// Errors are correlated over seconds, whereas blocks are practically independent. A further block is worse than the worst of four with a
/// probability of 1/5; half of all further blocks are worse than a factor that covers all rows together.
pub(crate) fn sd_scale(blocks: &[Vec<f64>]) -> f64 {
    sd_scale_up_to(blocks, *SCALES.end())
}

/// Returns the same factor with another upper limit.
pub(crate) fn sd_scale_up_to(blocks: &[Vec<f64>], widest: f64) -> f64 {
    let worst = blocks.iter().filter_map(|block| quantile(block, 95)).reduce(f64::max);
    worst.map_or(1.0, |deviation| (deviation / Z_95).clamp(*SCALES.start(), widest))
}

/// Returns the factor on the standard deviations with which the 50, 90 and 95 % intervals cover about these shares of all errors, given in
/// units of their deviations: the geometric mean of the three factors.
pub(crate) fn joint_scale(deviations: &[f64]) -> f64 {
    let factor = |(percent, z): (usize, f64)| Some((quantile(deviations, percent)? / z).ln());
    let factors: Option<Vec<f64>> = LEVELS.into_iter().map(factor).collect();
    let mean = factors.map(|factors| factors.iter().sum::<f64>() / LEVELS.len() as f64);
    mean.map_or(1.0, |mean| mean.exp().clamp(*JOINT_SCALES.start(), *JOINT_SCALES.end()))
}

/// Returns the same factor if deviations are not proportional to it: found iteratively from the errors at each factor.
pub(crate) fn joint_scale_of(deviations: impl Fn(f64) -> Vec<f64>) -> f64 {
    let next = |scale: f64| (scale * joint_scale(&deviations(scale))).clamp(*JOINT_SCALES.start(), *JOINT_SCALES.end());
    (0..TURNS).fold(1.0, |scale, _| next(scale))
}

fn quantile(deviations: &[f64], percent: usize) -> Option<f64> {
    let sorted = sorted(deviations.iter().copied());
    let rank = (sorted.len().saturating_sub(1) * percent).div_ceil(100);
    sorted.get(rank).copied()
}

#[cfg(test)]
mod tests {
    use super::{LEVELS, Z_95, joint_scale, joint_scale_of, sd_scale};

    /// Deviations 1/100, 2/100, … 1 in units of `factor` interval widths: the 95 % quantile is 0.95 of them.
    fn deviations(factor: f64) -> Vec<Vec<f64>> {
        vec![(1..=100).rev().map(|k| factor * Z_95 * f64::from(k) / 95.0).collect()]
    }

    #[test]
    fn the_worst_block_counts() {
        let blocks = [deviations(0.5), deviations(2.0), deviations(1.0)].concat();
        assert_eq!(sd_scale(&blocks), sd_scale(&deviations(2.0)));
    }

    /// Tests quantiles of a normal distribution twice as wide as stated.
    #[test]
    fn all_levels_count() {
        let normal = statrs::distribution::Normal::standard();
        let half =
            |k: usize| statrs::distribution::ContinuousCDF::inverse_cdf(&normal, 0.5 + 0.5 * (k as f64 + 0.5) / 1e4);
        let deviations: Vec<f64> = (0..10_000).map(|k| 2.0 * half(k)).collect();
        // Half a rank of 10 000 at the 95 % level is a probability of 5e-5; at the density 0.117 there this is 4e-4 / 1.96.
        assert!((joint_scale(&deviations) - 2.0).abs() < 1e-3);
        // Right at 50 and 90 %, twice as wide as stated at 95 %.
        let two = |share: f64| if share < 0.925 { 1.0 } else { 2.0 };
        let uneven: Vec<f64> = (0..10_000).map(|k| two(k as f64 / 1e4) * half(k)).collect();
        assert!((joint_scale(&uneven) - 2.0_f64.powf(1.0 / LEVELS.len() as f64)).abs() < 1e-3);
    }

    /// Half of the variance does not scale with the factor: errors 1.3 times a normal one, so that 0.5 + 0.5 s² = 1.69.
    #[test]
    fn a_factor_on_a_part_is_found() {
        let normal = deviations(1.0).concat();
        let whole = joint_scale(&normal);
        let left = |scale: f64| {
            let sd = whole * (0.5 + 0.5 * scale * scale).sqrt() / 1.3;
            normal.iter().map(|x| x / sd).collect()
        };
        let expected = 2.38_f64.sqrt();
        assert!((joint_scale_of(left) / expected - 1.0).abs() < 0.02, "{}", joint_scale_of(left));
    }

    #[test]
    fn the_interval_is_widened_and_never_narrowed() {
        assert!((sd_scale(&deviations(2.0)) - 2.0 * 96.0 / 95.0).abs() < 1e-12);
        assert_eq!((sd_scale(&deviations(100.0)), sd_scale(&deviations(0.5))), (5.0, 1.0));
        assert_eq!(sd_scale(&[]), 1.0);
    }
}
