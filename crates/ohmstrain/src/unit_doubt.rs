use ohmstrain_sensor::{ReadingUnit, SensorParams};

/// Smallest median reading, Ω, that is not taken for kΩ, unless the unit is known.
pub(crate) const LEAST_OHM: f64 = 20.0;

/// Factor by which readings may lie outside those of the calibration before another unit is considered: sensors of one kind differ
/// by less, units by more.
const READINGS_BEYOND: f64 = 2.0;
/// Resistance above which no sensor is connected, Ω.
const LARGEST_OHM: f64 = 1e6;

/// Readings that seem to be in another unit than the calibration's; see [`Sensor::check_unit`](crate::Sensor::check_unit).
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// use ohmstrain::UnitGuess;
///
/// let doubt = sensor.check_unit([1.600, 1.632], None).unwrap_err();
/// assert_eq!((doubt.column, doubt.guess), ("resistance_ohm", UnitGuess::KiloOhm));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitDoubt {
    /// Name of the readings' column, with their unit.
    pub column: &'static str,
    /// Least and largest reading of the calibration, moved to the R₀ in use.
    pub expected: (f64, f64),
    /// R₀ in use, if it is not the calibration's.
    pub rest_reading: Option<f64>,
    /// Median of the readings.
    pub median: f64,
    /// Guess of their unit.
    pub guess: UnitGuess,
}

/// Guess of the unit of readings that are in the wrong one.
///
/// ```
/// assert!(ohmstrain::UnitGuess::Percent.to_string().ends_with("are they in percent?"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UnitGuess {
    /// kΩ in place of Ω.
    KiloOhm,
    /// MΩ in place of Ω.
    MegaOhm,
    /// The calibration is in kΩ.
    CalibrationInKiloOhm,
    /// Ratios to some resistance at rest in place of Ω.
    Ratio,
    /// Percent in place of ratios.
    Percent,
    /// Ω in place of ratios.
    Ohm,
}

impl UnitDoubt {
    /// Returns a doubt; `None` if the readings are near those of the calibration, or if no unit explains their distance.
    pub(crate) fn of(params: &SensorParams, rest: f64, readings: impl Iterator<Item = f64>) -> Option<Self> {
        let median = quantile(readings, 0.5)?;
        let moved = rest / params.rest_reading;
        let (low, high) = (moved * params.validity.reading_lower, moved * params.validity.reading_upper);
        let suits = |reading: f64| (low / READINGS_BEYOND..=high * READINGS_BEYOND).contains(&reading);
        let guesses: &[(f64, UnitGuess)] = match params.reading {
            ReadingUnit::Ohm => &[
                (1e3, UnitGuess::KiloOhm),
                (1e6, UnitGuess::MegaOhm),
                (1e-3, UnitGuess::CalibrationInKiloOhm),
                (rest, UnitGuess::Ratio),
            ],
            // For ohms, the sensor's resistance at rest is unknown.
            ReadingUnit::Ratio if (LEAST_OHM..=LARGEST_OHM).contains(&median) => {
                &[(1e-2, UnitGuess::Percent), (rest / median, UnitGuess::Ohm)]
            }
            ReadingUnit::Ratio => &[(1e-2, UnitGuess::Percent)],
        };
        let (_, guess) = guesses.iter().find(|(factor, _)| !suits(median) && suits(factor * median))?;
        let column = crate::column::reading_column(params.reading);
        let rest_reading = Some(rest).filter(|_| moved != 1.0);
        Some(Self { column, expected: (low, high), rest_reading, median, guess: *guess })
    }
}

impl std::error::Error for UnitDoubt {}

/// Largest number of known values that are used; more values are thinned evenly.
const LOOKED_AT: usize = 1 << 17;

/// Returns the quantile of the known values at `share`; `None` if none is known. With many values, its rank errs by less than
/// one in ten thousand, and memory does not grow with their number.
pub(crate) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut known = spread(values.filter(|value| value.is_finite()));
    let rank = (share * known.len().checked_sub(1)? as f64) as usize;
    Some(*known.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// Returns all values, or at least half of [`LOOKED_AT`], taken at a constant stride.
fn spread(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut kept, mut apart) = (Vec::new(), 1);
    for (place, value) in values.enumerate() {
        if place % apart != 0 {
            continue;
        }
        if kept.len() == LOOKED_AT {
            let mut is_even = false;
            kept.retain(|_| {
                is_even = !is_even;
                is_even
            });
            apart *= 2;
        }
        // `LOOKED_AT` is even, so that the first index after halving is a multiple of the new stride.
        kept.push(value);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests quantiles of a ramp, which are known. A rank is rounded down to a kept value, and values after the last kept one
    /// are ignored: each errs by less than a stride, and at least `LOOKED_AT` / 2 values are kept.
    #[test]
    fn quantiles_of_long_recordings_take_little_memory() {
        for len in [1, 2, LOOKED_AT - 1, LOOKED_AT, LOOKED_AT + 1, 5 * LOOKED_AT + 3, 16 * LOOKED_AT] {
            let kept = spread((0..len).map(|k| k as f64));
            assert!(kept.len() <= LOOKED_AT && kept.len() >= len.min(LOOKED_AT / 2), "{len}: {}", kept.len());
            assert!(kept.capacity() <= LOOKED_AT);
            assert!(kept.windows(2).all(|pair| pair[1] - pair[0] == kept[1] - kept[0]), "{len}");
            for share in [0.0, 0.5, 0.95] {
                let found = quantile((0..len).map(|k| k as f64), share).unwrap();
                let exact = share * (len - 1) as f64;
                assert!(
                    (found - exact).abs() <= 1.0 + 2.0 * 2.0 * len as f64 / LOOKED_AT as f64,
                    "{len} {share}: {found}"
                );
            }
        }
        assert_eq!(quantile([f64::NAN, f64::INFINITY].into_iter(), 0.5), None);
    }
}
