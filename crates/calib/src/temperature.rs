//! Effect of temperature on the readings, fitted jointly with the law to recordings with known strain and temperature.

use nalgebra::{Cholesky, DMatrix, DVector};
use ohmstrain_sensor::TemperatureParams;

use crate::CalibrationError;
use crate::law::fit::{LawOptions, fit_structure};
use crate::law::least_squares::settle;
use crate::law::regression::LawRegression;
use crate::law::robust_loss::robust;
use crate::law::structure::{GaugeFamily, LawStructure};
use crate::law::uncertainty::Linearised;
use crate::order::{extent, median};
use crate::samples::{Samples, SamplesError, reading_range};

/// Least range of temperatures to fit an effect to, K.
const LEAST_RANGE_K: f64 = 3.0;
/// Number of standard deviations from zero at which a coefficient is used.
const SIGNIFICANT: f64 = 3.0;
/// Least share of a temperature's variance that relaxation, drift and motion do not explain.
const LEAST_OWN_SHARE: f64 = 0.04;
/// Share of the readings' range below which a possible effect is not worth a word.
const NOTEWORTHY: f64 = 0.05;
/// Largest number of Gauss-Newton steps; the change of the readings, relative to R₀, below which they stop.
const MOST_STEPS: usize = 12;
const SETTLED: f64 = 1e-5;
/// Number of passes that find R₀ for a known effect.
const PASSES: usize = 2;
/// Number of contiguous blocks of rows; residuals may be correlated within a block.
const BLOCKS: usize = 40;
/// Structure of the law: relaxation of two time constants.
const STRUCTURE: LawOptions = LawOptions { branches: 2, gauge: GaugeFamily::Polynomial };

/// Coefficients of temperature: R₀'s and the gain's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemperatureCoefficients {
    /// Relative change of R₀ per kelvin, with its standard deviation.
    pub rest_per_k: (f64, f64),
    /// Relative change per kelvin of the change with strain, with its standard deviation.
    pub gain_per_k: (f64, f64),
}

/// Effect of temperature on the readings of recordings, as far as these determine it.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureFit {
    /// The effect; `None` if there is none that is certain.
    pub effect: Option<TemperatureParams>,
    /// Reason why an effect could not be determined although the temperature moved.
    pub confounded: Option<Confounded>,
    /// Readings of each recording as they would be at the reference temperature; as recorded without an effect.
    pub readings: Vec<Vec<f64>>,
}

/// A temperature that moved with relaxation, drift or strain, so that an effect cannot be told from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confounded {
    /// Range of the temperatures, K.
    pub range_k: f64,
    /// Share of the temperature's variance that relaxation, drift and strain do not explain.
    pub own_share: f64,
    /// Fitted coefficients.
    pub coefficients: TemperatureCoefficients,
}

/// Temperatures of the rows of all recordings, °C: the median, and the ends.
#[derive(Clone, Copy)]
struct Range {
    reference_c: f64,
    lower_c: f64,
    upper_c: f64,
}

impl Range {
    fn of(recordings: &[Samples], temperature_c: &[&[f64]]) -> Option<Self> {
        let of_one = |(samples, values): (&Samples, &&[f64])| {
            samples.complete_rows().filter_map(|row| values.get(row).copied()).collect::<Vec<f64>>()
        };
        let mut known: Vec<f64> = recordings.iter().zip(temperature_c).flat_map(of_one).collect();
        known.retain(|value| value.is_finite());
        let (lower_c, upper_c) = extent(known.iter().copied());
        Some(Self { reference_c: median(known)?, lower_c, upper_c })
    }

    fn effect(self, [rest_per_k, gain_per_k]: [f64; 2], [rest_per_k_sd, gain_per_k_sd]: [f64; 2]) -> TemperatureParams {
        let Self { reference_c, lower_c, upper_c } = self;
        TemperatureParams { reference_c, lower_c, upper_c, rest_per_k, rest_per_k_sd, gain_per_k, gain_per_k_sd }
    }

    fn range_k(self) -> f64 {
        self.upper_c - self.lower_c
    }
}

/// Returns readings as they would be at the reference temperature, given R₀ of each recording there.
fn at_reference(
    recordings: &[Samples],
    temperature_c: &[&[f64]],
    effect: &TemperatureParams,
    rest_readings: &[f64],
) -> Vec<Vec<f64>> {
    let of_one = |((samples, values), rest): ((&Samples, &&[f64]), &f64)| {
        effect.column_at_reference(*rest, samples.reading, values)
    };
    recordings.iter().zip(temperature_c).zip(rest_readings).map(of_one).collect()
}

/// Fits the coefficients of temperature by Gauss-Newton steps, jointly with a law of two branches and a linear drift of each recording;
/// or takes those that are `given`. Standard deviations are by the block jackknife. `temperature_c` holds a value for each row, NaN where
/// missing.
///
/// Each recording has its own R₀; differences between recordings are not attributed to their temperatures.
///
/// # Errors
/// If a recording has another number of temperatures than rows; or, with coefficients that are given, if no law fits.
pub fn fit_temperature(
    recordings: &[Samples],
    temperature_c: &[&[f64]],
    given: Option<TemperatureCoefficients>,
) -> Result<TemperatureFit, CalibrationError> {
    for (samples, values) in recordings.iter().zip(temperature_c) {
        if values.len() != samples.len() {
            let (times, strains) = (samples.len(), samples.strain.len());
            return Err(SamplesError::Lengths { times, readings: values.len(), strains }.into());
        }
    }
    let as_recorded = || recordings.iter().map(|samples| samples.reading.to_vec()).collect();
    let none = |confounded| Ok(TemperatureFit { effect: None, confounded, readings: as_recorded() });
    let Some(range) = Range::of(recordings, temperature_c) else { return none(None) };
    let joint = Joint { recordings, temperature_c, range, fits_gain: true };
    if let Some(TemperatureCoefficients { rest_per_k, gain_per_k }) = given {
        let effect = range.effect([rest_per_k.0, gain_per_k.0], [rest_per_k.1, gain_per_k.1]);
        let rests = joint.rest_readings(&effect)?;
        return Ok(joint.found(effect, &rests));
    }
    if range.range_k() < LEAST_RANGE_K {
        return none(None);
    }
    // Recordings that no law fits are reported by the calibration itself.
    let Ok(rest_only) = Joint { fits_gain: false, ..joint }.fitted([0.0; 2]) else { return none(None) };
    // A gain that cannot be told from R₀ may make the equations singular; R₀'s coefficient then covers both.
    let both = joint.fitted(rest_only.coefficients).ok();
    let both = both.filter(|both| both.own_share >= LEAST_OWN_SHARE && both.is_certain(1));
    let fitted = both.unwrap_or(rest_only);
    let (is_certain, moves_alone) = (fitted.is_certain(0) || fitted.is_certain(1), fitted.own_share >= LEAST_OWN_SHARE);
    if is_certain && moves_alone {
        return Ok(joint.found(range.effect(fitted.coefficients, fitted.sd), &fitted.rests));
    }
    let Fitted { own_share, coefficients: [rest, gain], sd: [rest_sd, gain_sd], .. } = fitted;
    let (lowest, highest) = reading_range(recordings);
    let largest = (rest.abs() + 2.0 * rest_sd) * range.range_k();
    if moves_alone && largest < NOTEWORTHY * (highest / lowest - 1.0) {
        return none(None);
    }
    let coefficients = TemperatureCoefficients { rest_per_k: (rest, rest_sd), gain_per_k: (gain, gain_sd) };
    none(Some(Confounded { range_k: range.range_k(), own_share, coefficients }))
}

/// A joint fit of law, drift and temperature.
#[derive(Clone, Copy)]
struct Joint<'a> {
    recordings: &'a [Samples<'a>],
    temperature_c: &'a [&'a [f64]],
    range: Range,
    /// False if only R₀ depends on the temperature.
    fits_gain: bool,
}

struct Fitted {
    coefficients: [f64; 2],
    sd: [f64; 2],
    /// Share of the temperature's variance that nothing else in the fit explains.
    own_share: f64,
    /// R₀ of each recording, at the reference temperature.
    rests: Vec<f64>,
}

impl Fitted {
    fn is_certain(&self, place: usize) -> bool {
        self.coefficients[place].abs() > SIGNIFICANT * self.sd[place]
    }
}

impl Joint<'_> {
    /// Returns the fit with an effect that is certain.
    fn found(&self, effect: TemperatureParams, rests: &[f64]) -> TemperatureFit {
        let readings = at_reference(self.recordings, self.temperature_c, &effect, rests);
        TemperatureFit { effect: Some(effect), confounded: None, readings }
    }

    /// Returns the law's regression on readings at the reference temperature.
    fn regression(&self, effect: &TemperatureParams, rests: &[f64]) -> Result<LawRegression, CalibrationError> {
        let readings = at_reference(self.recordings, self.temperature_c, effect, rests);
        let pairs = self.recordings.iter().zip(&readings);
        let converted: Vec<Samples> = pairs.map(|(samples, reading)| Samples { reading, ..*samples }).collect();
        Ok(robust(LawRegression::new(&converted)?))
    }

    /// Returns R₀ of each recording at the reference temperature, for an effect that is known.
    fn rest_readings(&self, effect: &TemperatureParams) -> Result<Vec<f64>, CalibrationError> {
        let mut rests = self.median_readings();
        for _ in 0..PASSES {
            let regression = self.regression(effect, &rests)?;
            let (structure, _) = fit_structure(&regression, STRUCTURE)?;
            rests = Linearised::new(&structure, &regression)?.rest_readings().to_vec();
        }
        Ok(rests)
    }

    fn median_readings(&self) -> Vec<f64> {
        let known = |samples: &Samples| median(samples.reading.iter().copied().filter(|value| value.is_finite()));
        self.recordings.iter().map(|samples| known(samples).unwrap_or(1.0)).collect()
    }

    /// Fits the coefficients, from a first guess.
    fn fitted(&self, mut coefficients: [f64; 2]) -> Result<Fitted, CalibrationError> {
        let mut rests = self.median_readings();
        let mut structure: Option<LawStructure> = None;
        let mut last = None;
        let (mut share, mut before) = (1.0, [0.0; 2]);
        for _ in 0..MOST_STEPS {
            let regression = self.regression(&self.range.effect(coefficients, [0.0; 2]), &rests)?;
            let begun = structure.take().map_or_else(|| fit_structure(&regression, STRUCTURE).map(|fit| fit.0), Ok)?;
            let settled = settle(begun, &regression)?;
            let system = System::new(&Linearised::new(&settled, &regression)?, &regression, self);
            let step = system.step().ok_or(CalibrationError::Singular)?;
            let change = system.of_coefficients(&step);
            rests.clone_from(&system.rests);
            structure = Some(settled);
            // The law is fitted between the steps; where it shares an effect with the temperature, full steps overshoot.
            if change[0] * before[0] + change[1] * before[1] < 0.0 {
                share *= 0.5;
            }
            before = change;
            coefficients.iter_mut().zip(change).for_each(|(coefficient, change)| *coefficient += share * change);
            let moved = change.iter().map(|change| change.abs()).sum::<f64>() * self.range.range_k();
            last = Some((system, step));
            if moved < SETTLED {
                break;
            }
        }
        let (system, step) = last.ok_or(CalibrationError::Singular)?;
        let uncertain = system.deviations(&step).zip(system.own_share());
        let (sd, own_share) = uncertain.ok_or(CalibrationError::Singular)?;
        Ok(Fitted { coefficients, sd, own_share, rests })
    }

    /// Returns the difference from the reference temperature in each row, K; zero where it is missing.
    fn above_k(&self, recording: usize) -> DVector<f64> {
        let above = |value: &f64| if value.is_finite() { value - self.range.reference_c } else { 0.0 };
        DVector::from_iterator(self.temperature_c[recording].len(), self.temperature_c[recording].iter().map(above))
    }
}

/// The equations of a Gauss-Newton step: columns of the law and of drifts, and last those of the coefficients of temperature.
struct System {
    columns: DMatrix<f64>,
    /// `columnsᵀ columns`, with the law's penalty.
    normal: DMatrix<f64>,
    residual: DVector<f64>,
    /// Weighted difference from the reference temperature, K.
    above_k: DVector<f64>,
    /// Number of coefficients of temperature.
    coefficients: usize,
    rests: Vec<f64>,
}

impl System {
    fn new(law: &Linearised, regression: &LawRegression, joint: &Joint) -> Self {
        let response = regression.response(law.rest_readings());
        let mut above_k = (0..joint.recordings.len()).map(|recording| joint.above_k(recording));
        let above_k = regression.column(|_| above_k.next().unwrap_or_default());
        let mut extra: Vec<DVector<f64>> =
            (0..joint.recordings.len()).map(|one| drift(regression, joint, one)).collect();
        extra.push(above_k.component_mul(&response));
        if joint.fits_gain {
            extra.push(above_k.component_mul(&response.add_scalar(-1.0)));
        }
        let coefficients = if joint.fits_gain { 2 } else { 1 };
        let weights = regression.root_weights();
        let own = law.jacobian.column_iter().map(|column| column.into_owned());
        let extra = extra.iter().map(|column| column.component_mul(&weights));
        let columns = DMatrix::from_columns(&own.chain(extra).collect::<Vec<_>>());
        let mut normal = columns.tr_mul(&columns);
        let penalised = law.normal();
        normal.view_mut((0, 0), penalised.shape()).copy_from(&penalised);
        // A column of a recording without any motion of its temperature has no effect.
        for j in 0..normal.nrows() {
            if normal[(j, j)] <= 0.0 {
                normal[(j, j)] = 1.0;
            }
        }
        let above_k = above_k.component_mul(&weights);
        Self {
            columns,
            normal,
            residual: law.residual.clone(),
            above_k,
            coefficients,
            rests: law.rest_readings().to_vec(),
        }
    }

    /// Returns the step of all columns' weights; `None` if the equations are singular.
    fn step(&self) -> Option<DVector<f64>> {
        let mut gradient = self.columns.tr_mul(&self.residual);
        // The law's own columns are at their optimum.
        gradient.rows_mut(0, self.first() - self.drifts()).fill(0.0);
        Some(Cholesky::new(self.normal.clone())?.solve(&gradient))
    }

    /// Returns the standard deviations of the coefficients by the block jackknife, after a step; `None` if the equations without a block
    /// are singular.
    fn deviations(&self, step: &DVector<f64>) -> Option<[f64; 2]> {
        let left = &self.residual - &self.columns * step;
        let rows = self.columns.nrows();
        let mut variance = [0.0; 2];
        for block in 0..BLOCKS {
            let (start, end) = (block * rows / BLOCKS, (block + 1) * rows / BLOCKS);
            let columns = self.columns.rows(start, end - start);
            let gradient = columns.tr_mul(&left.rows(start, end - start));
            let moved = Cholesky::new(&self.normal - columns.tr_mul(&columns))?.solve(&gradient);
            self.of_coefficients(&moved).iter().zip(&mut variance).for_each(|(moved, sum)| *sum += moved * moved);
        }
        let jackknife = (BLOCKS - 1) as f64 / BLOCKS as f64;
        Some(variance.map(|sum| (jackknife * sum).sqrt()))
    }

    /// Returns the share of the temperature's variance that the columns but that of R₀'s coefficient do not explain.
    fn own_share(&self) -> Option<f64> {
        let (columns, normal) = (self.columns.clone().remove_column(self.first()), self.normal.clone());
        let normal = normal.remove_column(self.first()).remove_row(self.first());
        let along = columns.tr_mul(&self.above_k);
        let explained = along.dot(&Cholesky::new(normal)?.solve(&along));
        let total = self.above_k.norm_squared() - self.above_k.sum().powi(2) / self.above_k.len() as f64;
        Some((self.above_k.norm_squared() - explained).max(0.0) / total)
    }

    /// Returns the place of R₀'s coefficient among the columns.
    fn first(&self) -> usize {
        self.normal.nrows() - self.coefficients
    }

    /// Returns the coefficients of temperature among the columns' weights; zero for a gain that is not fitted.
    fn of_coefficients(&self, weights: &DVector<f64>) -> [f64; 2] {
        let gain = if self.coefficients == 2 { weights[self.first() + 1] } else { 0.0 };
        [weights[self.first()], gain]
    }

    /// Number of columns of drift, one for each recording.
    fn drifts(&self) -> usize {
        self.rests.len()
    }
}

/// Returns a linear drift of one recording, from -1/2 to 1/2.
fn drift(regression: &LawRegression, joint: &Joint, one: usize) -> DVector<f64> {
    let mut place = 0;
    regression.column(|_| {
        let time_s = joint.recordings[place].time_s;
        let is_one = place == one;
        place += 1;
        let (first, last) = (time_s.first().copied().unwrap_or(0.0), time_s.last().copied().unwrap_or(1.0));
        DVector::from_iterator(
            time_s.len(),
            time_s.iter().map(|t| if is_one { (t - first) / (last - first) - 0.5 } else { 0.0 }),
        )
    })
}
