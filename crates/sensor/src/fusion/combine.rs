use nalgebra::{DMatrix, DVector};

/// Mean and standard deviation of one member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Strain.
    pub strain: f64,
    /// Its standard deviation.
    pub sd: f64,
}

impl Member {
    /// A member without an estimate.
    pub const UNKNOWN: Self = Self { strain: f64::NAN, sd: f64::NAN };
}

/// Returns the best linear unbiased estimate from members with correlated errors, restricted to weights that are not negative: a
/// negative weight would assume that a member is wrong.
///
/// `covariance(i, j)` is the covariance of the errors of members i and j, in units of their standard deviations. `None` if there is
/// no member, or the covariance is not positive definite.
///
/// Source: J. M. Bates, C. W. J. Granger, The combination of forecasts, *Operational Research Quarterly* 20 (1969) 451–468.
#[must_use]
pub fn combine(members: &[Member], covariance: impl Fn(usize, usize) -> f64) -> Option<Member> {
    let mut used: Vec<usize> =
        (0..members.len()).filter(|&v| members[v].strain.is_finite() && members[v].sd > 0.0).collect();
    while !used.is_empty() {
        let n = used.len();
        let between = |i: usize, j: usize| {
            let (a, b) = (used[i], used[j]);
            members[a].sd * members[b].sd * covariance(a, b)
        };
        let factor = DMatrix::from_fn(n, n, between).cholesky()?;
        let weights = factor.solve(&DVector::from_element(n, 1.0));
        let sum = weights.sum();
        if weights.iter().all(|weight| *weight >= 0.0) {
            let strain = weights.iter().zip(&used).map(|(weight, v)| weight * members[*v].strain).sum::<f64>() / sum;
            return Some(Member { strain, sd: (1.0 / sum).sqrt() });
        }
        used = used.iter().zip(weights.iter()).filter(|(_, weight)| **weight >= 0.0).map(|(v, _)| *v).collect();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{Member, combine};

    /// Two errors of standard deviations a and b and correlation r: the weight of the first is (b² − r a b) / (a² + b² − 2 r a b).
    #[test]
    fn two_members_are_weighted_as_bates_and_granger_do() {
        let (a, b, r) = (1.0, 2.0, 0.3);
        let members = [Member { strain: 10.0, sd: a }, Member { strain: 20.0, sd: b }];
        let fused = combine(&members, |i, j| if i == j { 1.0 } else { r }).unwrap();
        let all = a * a + b * b - 2.0 * r * a * b;
        let weight = (b * b - r * a * b) / all;
        assert!((fused.strain - (10.0 * weight + 20.0 * (1.0 - weight))).abs() < 1e-12);
        assert!((fused.sd.powi(2) - a * a * b * b * (1.0 - r * r) / all).abs() < 1e-12);
    }

    /// The second member's weight would be negative where r is above a/b.
    #[test]
    fn a_member_that_only_repeats_a_better_one_has_no_weight() {
        let members = [Member { strain: 10.0, sd: 1.0 }, Member { strain: 20.0, sd: 2.0 }];
        assert_eq!(combine(&members, |i, j| if i == j { 1.0 } else { 0.8 }).unwrap(), members[0]);
    }
}
