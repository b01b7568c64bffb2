use crate::dense::product;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Least spread between sensors, as a fraction of the observed spread, in every direction; the errors that are subtracted are not known
/// well enough for less.
const LEAST_SHARE: f64 = 0.1;

/// Mean and spread of a population.
#[derive(Clone, Debug)]
pub(super) struct Population {
    pub mean: DVector<f64>,
    /// Covariance of one more member around `mean`, which is itself an estimate from `n` members.
    pub covariance: DMatrix<f64>,
}

impl Population {
    /// Estimates the population from at least two members; `errors` is the covariance of a typical member's own errors, if it is known.
    ///
    /// The sample covariance is shrunk toward its diagonal, the errors are subtracted, and the uncertainty of the mean is added:
    /// the predictive distribution of one more member, `N(m, Σ + S/n)`.
    pub(super) fn new(members: &[DVector<f64>], errors: Option<&DMatrix<f64>>) -> Self {
        let n = members.len() as f64;
        let size = members.first().map_or(0, |first| first.len());
        let mean = members.iter().fold(DVector::zeros(size), |sum, member| sum + member) / n;
        let seen = shrunken(members, &mean);
        let between = errors.map_or_else(|| seen.clone(), |errors| without(&seen, errors));
        let covariance: DMatrix<f64> = between + seen / n;
        // Symmetrises, because rounding is not symmetric.
        Self { covariance: 0.5 * (&covariance + covariance.transpose()), mean }
    }
}

/// Returns the sample covariance with its correlations shrunk toward zero by the factor that minimises their expected squared error.
///
/// Source: Schäfer & Strimmer, *Stat. Appl. Genet. Mol. Biol.* 4 (2005) 32, target D.
fn shrunken(members: &[DVector<f64>], mean: &DVector<f64>) -> DMatrix<f64> {
    let (n, size) = (members.len() as f64, mean.len());
    let sd = |i: usize| (members.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let sds: Vec<f64> = (0..size).map(sd).collect();
    let unit = |i: usize| if sds[i] > 0.0 { sds[i] } else { 1.0 };
    let standardised: Vec<Vec<f64>> =
        members.iter().map(|x| (0..size).map(|i| (x[i] - mean[i]) / unit(i)).collect()).collect();
    let mut correlation = DMatrix::identity(size, size);
    let (mut uncertain, mut squares) = (0.0, 0.0);
    for i in 0..size {
        for j in 0..i {
            let products = || standardised.iter().map(|x| x[i] * x[j]);
            let product = products().sum::<f64>() / n;
            let found = product * n / (n - 1.0);
            let scatter = products().map(|w| (w - product).powi(2)).sum::<f64>();
            uncertain += scatter * n / (n - 1.0).powi(3);
            squares += found * found;
            (correlation[(i, j)], correlation[(j, i)]) = (found, found);
        }
    }
    let share = if squares > 0.0 { (uncertain / squares).clamp(0.0, 1.0) } else { 1.0 };
    DMatrix::from_fn(size, size, |i, j| {
        let kept = if i == j { 1.0 } else { (1.0 - share) * correlation[(i, j)] };
        kept * sds[i] * sds[j]
    })
}

/// Returns `seen - errors`, kept positive: in directions in which errors explain more than nine tenths of `seen`, a tenth of it remains.
///
/// Source: Amemiya, *Am. Stat.* 39 (1985) 112, on between-group covariances that come out negative.
fn without(seen: &DMatrix<f64>, errors: &DMatrix<f64>) -> DMatrix<f64> {
    let whole = SymmetricEigen::new(seen.clone());
    let tiny = whole.eigenvalues.max() * 1e-12;
    let roots = whole.eigenvalues.map(|x| x.max(tiny).sqrt());
    if !(tiny > 0.0) {
        return seen.clone();
    }
    let coloured = product(&whole.eigenvectors, &DMatrix::from_diagonal(&roots));
    let white = product(&DMatrix::from_diagonal(&roots.map(|x| 1.0 / x)), &whole.eigenvectors.transpose());
    let share = SymmetricEigen::new(product(&product(&white, errors), &white.transpose()));
    let left = share.eigenvalues.map(|share| (1.0 - share).clamp(LEAST_SHARE, 1.0));
    let axes = product(&coloured, &share.eigenvectors);
    product(&product(&axes, &DMatrix::from_diagonal(&left)), &axes.transpose())
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{Population, without};

    fn number(value: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, value)
    }

    /// Compares with values computed by hand: mean 3, squares 4 + 1 + 1 + 4 over three degrees of freedom.
    #[test]
    fn one_number_is_the_normal_normal_model() {
        let members: Vec<DVector<f64>> = [1.0, 2.0, 4.0, 5.0].iter().map(|x| DVector::from_element(1, *x)).collect();
        let seen: f64 = 10.0 / 3.0;
        let cases = [(None, seen), (Some(1.0), seen - 1.0), (Some(3.3), 0.1 * seen), (Some(1e9), 0.1 * seen)];
        for (error, between) in cases {
            let found = Population::new(&members, error.map(number).as_ref());
            assert!((found.mean[0] - 3.0).abs() < 1e-12);
            let expected = between + seen / 4.0;
            assert!((found.covariance[(0, 0)] - expected).abs() < 1e-9, "{error:?}: {} {expected}", found.covariance);
        }
    }

    /// Compares with Schäfer & Strimmer's shrinkage, written out for two standardised columns: Var(r)/r².
    #[test]
    fn correlations_are_shrunken_by_the_share_that_their_scatter_asks_for() {
        let (first, second) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.2, 0.7, 2.9, 2.2, 4.0]);
        let members: Vec<DVector<f64>> =
            first.iter().zip(second).map(|(a, b)| DVector::from_column_slice(&[*a, b])).collect();
        let found = Population::new(&members, None).covariance / (1.0 + 1.0 / 5.0);
        let sd = |values: [f64; 5]| {
            let mean = values.iter().sum::<f64>() / 5.0;
            (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4.0).sqrt()
        };
        let (sd_a, sd_b) = (sd(first), sd(second));
        let products: Vec<f64> = members.iter().map(|x| (x[0] - 2.0) / sd_a * (x[1] - 2.0) / sd_b).collect();
        let mean = products.iter().sum::<f64>() / 5.0;
        let correlation = mean * 5.0 / 4.0;
        let variance = 5.0 / 64.0 * products.iter().map(|w| (w - mean).powi(2)).sum::<f64>();
        let share = variance / correlation.powi(2);
        assert!(share > 0.0 && share < 1.0);
        let expected = (1.0 - share) * correlation * sd_a * sd_b;
        assert!((found[(0, 1)] - expected).abs() < 1e-9, "{found} {expected}");
        assert!((found[(0, 0)] - sd_a * sd_a).abs() < 1e-9 && (found[(1, 1)] - sd_b * sd_b).abs() < 1e-9);
    }

    /// Tests errors with the axes of the sample covariance: they are subtracted variance by variance.
    #[test]
    fn errors_are_taken_off_along_their_own_axes() {
        let turn = DMatrix::from_row_slice(2, 2, &[0.8, -0.6, 0.6, 0.8]);
        let of =
            |a: f64, b: f64| &turn * DMatrix::from_diagonal(&DVector::from_column_slice(&[a, b])) * turn.transpose();
        let found = without(&of(4.0, 1.0), &of(1.0, 50.0));
        assert!((found - of(3.0, 0.1)).amax() < 1e-9);
    }
}
