use crate::CalibrationError;
use crate::law::blocked_normal::BlockedNormal;
use crate::law::design::BRANCH_COLUMNS;
use crate::law::regression::{LawRegression, VALIDATION_BLOCKS};
use crate::law::robust_loss::robust;
use crate::law::structure::{GaugeFamily, LawFit, LawStructure};
use crate::optimise::{Ends, nelder_mead};
use crate::samples::Samples;
use ohmstrain_sensor::{EstimatorKind, MOST_BRANCHES};

/// Structure of a law: gauge family and number of branches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawOptions {
    /// Number of branches, 0 to 4.
    pub branches: usize,
    /// Family of the gauge curve.
    pub gauge: GaugeFamily,
}

impl Default for LawOptions {
    fn default() -> Self {
        Self::with_branches(DEFAULT_BRANCHES)
    }
}

impl LawOptions {
    /// Returns the structures from which a calibration for this estimator chooses by default: one to three branches for estimators that
    /// gain from the choice, two for the others.
    #[must_use]
    pub const fn candidates(kind: EstimatorKind) -> &'static [Self] {
        const TWO: LawOptions = LawOptions::with_branches(DEFAULT_BRANCHES);
        const ANY: [LawOptions; 3] = [LawOptions::with_branches(1), TWO, LawOptions::with_branches(3)];
        match kind {
            EstimatorKind::Ekf | EstimatorKind::SignSplit | EstimatorKind::StaticCubic => &ANY,
            _ => &[TWO],
        }
    }

    const fn with_branches(branches: usize) -> Self {
        Self { branches, gauge: DEFAULT_GAUGE }
    }
}

/// A law, and the same law fitted again without each block of the recordings, which measures its error outside the rows of the fit.
#[derive(Clone, Debug)]
pub struct CrossFit {
    /// Law fitted to all rows.
    pub law: LawFit,
    /// Laws fitted without block k of every recording.
    pub without_block: Vec<LawFit>,
    /// Rows of the blocks, `blocks[recording][k]`.
    pub blocks: Vec<Vec<std::ops::Range<usize>>>,
}

/// Number of branches of a law that is fitted by itself.
const DEFAULT_BRANCHES: usize = 2;
/// Default family. Others sometimes follow the resistance slightly better, but only the polynomial is linear in its coefficients: the ridge
/// then keeps it smooth, and the filter does not confuse directions.
const DEFAULT_GAUGE: GaugeFamily = GaugeFamily::Polynomial;
/// Number of time constants on the grid.
const GRID: usize = 12;
/// Ridges tried, relative to the variance of each column. The least one explains most, but often makes a filter lock onto the wrong
/// direction; the scores of the estimators choose.
const LAW_RIDGES: [f64; 5] = [0.1, 0.03, 0.01, 0.003, 0.001];
/// Steps of the polish of the time constants, and the side of its first simplex in ln τ.
const POLISH_ENDS: Ends = Ends { iterations: 40, least_gain: 0.0 };
const POLISH_SIDE: f64 = 0.3;
/// Smallest distance between time constants on the grid, in ln τ, if the bounds allow it: closer ones trade off their gains. The polish may
/// halve it.
const LEAST_SPACING: f64 = 1.6;

/// Fits the switched Kelvin-Voigt law with gains affine in strain, by separable least squares: the time constants are searched on a grid
/// and then locally, all other parameters follow from ridge regression.
///
/// Time constants and ridge come from cross-validation on contiguous blocks.
///
/// # Errors
/// If the recordings are too short, the strain is constant or no law fits.
pub fn fit_law(recordings: &[Samples], options: LawOptions) -> Result<CrossFit, CalibrationError> {
    let laws = fit_ridges(recordings, options)?;
    let least = |a: &CrossFit, b: &CrossFit| a.law.cross_validated_error.total_cmp(&b.law.cross_validated_error);
    laws.into_iter().min_by(least).ok_or(CalibrationError::Singular)
}

impl CrossFit {
    /// Returns the number of branches.
    pub(crate) fn branches(&self) -> usize {
        self.law.law.branches.len()
    }
}

/// Returns the best law for each structure and ridge, fewest branches and strongest ridge first; at least one.
pub(crate) fn fit_laws(recordings: &[Samples], structures: &[LawOptions]) -> Result<Vec<CrossFit>, CalibrationError> {
    let fits: Vec<_> = structures.iter().map(|structure| fit_ridges(recordings, *structure)).collect();
    if fits.iter().all(Result::is_err) {
        return fits.into_iter().next().unwrap_or_else(|| Err(CalibrationError::Unsupported("no structure".into())));
    }
    let mut laws: Vec<CrossFit> = fits.into_iter().flatten().flatten().collect();
    laws.sort_by_key(CrossFit::branches);
    Ok(laws)
}

/// Returns the best law for each ridge, strongest ridge first; at least one.
fn fit_ridges(recordings: &[Samples], options: LawOptions) -> Result<Vec<CrossFit>, CalibrationError> {
    if options.branches > MOST_BRANCHES {
        return Err(ohmstrain_sensor::SensorError::Branches { found: options.branches }.into());
    }
    let regression = robust(LawRegression::new(recordings)?);
    let grid = TauGrid::new(&regression, options.branches);
    let fits = LAW_RIDGES.map(|ridge| cross_fit(&regression, &grid, options.gauge, ridge));
    if fits.iter().all(Result::is_err) {
        return fits.into_iter().collect();
    }
    Ok(fits.into_iter().flatten().collect())
}

fn cross_fit(
    regression: &LawRegression,
    grid: &TauGrid,
    gauge: GaugeFamily,
    ridge: f64,
) -> Result<CrossFit, CalibrationError> {
    let mut structure = polish(regression, gauge, &grid.best(ridge)?, ridge)?;
    structure.sort_branches();
    let without_block =
        (0..VALIDATION_BLOCKS).map(|block| structure.fit(regression, Some(block))).collect::<Result<_, _>>()?;
    Ok(CrossFit { law: structure.fit(regression, None)?, without_block, blocks: regression.block_rows() })
}

/// Returns the structure that cross-validation with this ridge chooses on the grid of time constants.
pub(crate) fn structure_on_grid(
    regression: &LawRegression,
    LawOptions { branches, gauge: family }: LawOptions,
    ridge: f64,
) -> Result<LawStructure, CalibrationError> {
    Ok(LawStructure { family, nonlinear: TauGrid::new(regression, branches).best(ridge)?, taus: branches, ridge })
}

/// Fits one structure with the least ridge.
pub(crate) fn fit_structure(
    regression: &LawRegression,
    options: LawOptions,
) -> Result<(LawStructure, LawFit), CalibrationError> {
    let ridge = LAW_RIDGES[LAW_RIDGES.len() - 1];
    let ln_taus = TauGrid::new(regression, options.branches).best(ridge)?;
    let structure = polish(regression, options.gauge, &ln_taus, ridge)?;
    let fit = structure.fit(regression, None)?;
    Ok((structure, fit))
}

/// A cubic gauge with branches of all time constants of a grid, for fits with a few of them.
struct TauGrid {
    ln_taus: Vec<f64>,
    normal: BlockedNormal,
    first_branch: usize,
    subsets: Vec<Vec<usize>>,
}

impl TauGrid {
    fn new(regression: &LawRegression, branches: usize) -> Self {
        let ln_taus = log_grid(regression.tau_bounds, GRID);
        let (family, nonlinear, ridge) = (GaugeFamily::Polynomial, ln_taus.clone(), LAW_RIDGES[0]);
        let everything = LawStructure { family, nonlinear, taus: GRID, ridge };
        let design = everything.design(regression);
        let spacing = LEAST_SPACING.min(0.7 * (ln_taus[GRID - 1] - ln_taus[0]) / (branches.max(2) - 1) as f64);
        let mut subsets = subsets(GRID, branches);
        subsets.retain(|subset| subset.windows(2).all(|pair| ln_taus[pair[1]] - ln_taus[pair[0]] >= spacing - 1e-9));
        Self {
            normal: regression.normal(&design, &regression.median_readings()),
            first_branch: design.columns.len() - GRID * BRANCH_COLUMNS,
            ln_taus,
            subsets,
        }
    }

    /// Returns the best logarithms of time constants by cross-validation.
    fn best(&self, ridge: f64) -> Result<Vec<f64>, CalibrationError> {
        let score = |subset: &Vec<usize>| {
            let mut columns: Vec<usize> = (0..self.first_branch).collect();
            for &i in subset {
                columns.extend((0..BRANCH_COLUMNS).map(|j| self.first_branch + i * BRANCH_COLUMNS + j));
            }
            self.normal.cross_validate(&columns, ridge)
        };
        let scored = self.subsets.iter().filter_map(|subset| Some((score(subset)?, subset)));
        let (_, subset) = scored.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or(CalibrationError::Singular)?;
        Ok(subset.iter().map(|&i| self.ln_taus[i]).collect())
    }
}

/// Moves time constants and gauge parameters to the minimum of the cross-validation error.
fn polish(
    regression: &LawRegression,
    family: GaugeFamily,
    ln_taus: &[f64],
    ridge: f64,
) -> Result<LawStructure, CalibrationError> {
    let mut start = ln_taus.to_vec();
    start.extend(match family {
        GaugeFamily::Polynomial => vec![],
        GaugeFamily::DecayingExponential => vec![0.0],
        GaugeFamily::Tunnelling => vec![0.5, 0.0, 0.0],
    });
    let structure =
        |nonlinear: &[f64]| LawStructure { family, nonlinear: nonlinear.to_vec(), taus: ln_taus.len(), ridge };
    // The ends of the grid are the bounds, up to rounding.
    let (low, high) = (regression.tau_bounds.0.ln() - 1e-9, regression.tau_bounds.1.ln() + 1e-9);
    let least = ln_taus.windows(2).map(|pair| pair[1] - pair[0]).fold(LEAST_SPACING, f64::min);
    let spacing = 0.5 * least;
    let score = |nonlinear: &[f64]| {
        let taus = &nonlinear[..ln_taus.len()];
        let apart = |i: usize| taus[..i].iter().all(|other| (taus[i] - other).abs() >= spacing);
        let inside = taus.iter().enumerate().all(|(i, ln_tau)| (low..=high).contains(ln_tau) && apart(i));
        let design = inside.then(|| structure(nonlinear).design(regression))?;
        regression.solve(&design, ridge, None).map(|solution| solution.cross_validated.ln())
    };
    let cost = |nonlinear: &[f64]| score(nonlinear).unwrap_or(f64::INFINITY);
    let point = if start.is_empty() { start } else { nelder_mead(cost, &start, POLISH_SIDE, POLISH_ENDS) };
    Ok(structure(&point))
}

/// Returns `count` logarithms, evenly spaced between those of the bounds.
fn log_grid(bounds: (f64, f64), count: usize) -> Vec<f64> {
    let (low, high) = (bounds.0.ln(), bounds.1.ln());
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1) as f64).collect()
}

/// Returns all ascending choices of `count` out of `0..size`.
fn subsets(size: usize, count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![vec![]];
    }
    let mut out = Vec::new();
    for mut smaller in subsets(size, count - 1) {
        let first = smaller.last().map_or(0, |last| last + 1);
        for i in first..size {
            smaller.push(i);
            out.push(smaller.clone());
            smaller.pop();
        }
    }
    out
}
