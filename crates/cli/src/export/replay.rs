//! A recording through the exported program's twin.

use ohmstrain_calib::{SensorParams, with_sizes};
use ohmstrain_ekf::live::{LiveEstimate, LiveFilter, SensorEstimator};
use ohmstrain_ekf::{Real, StepError};

use super::fixed_rate::FixedRate;
use super::plan::{ChipFilter, Plan};
use super::twin::{StepNumbers, Task, Twin, bits, with_twin};
use super::vectors::{Input, relative};
use super::{ExportError, too_many_branches};

/// A row of a recording; a missing reading is NaN.
pub struct ReplayedRow {
    /// Since the row before, or the first since the start, s.
    pub since_s: f32,
    /// The reading, in the sensor's unit.
    pub reading: f64,
    /// The deviation that its electronics add, in the same unit.
    pub reading_sd: f64,
}

/// A row as the exported program in single precision reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Said<T = f32> {
    /// Strain.
    pub strain: T,
    /// Its deviation.
    pub sd: T,
    /// `ohmstrain_flag` in C.
    pub flags: u32,
}

/// Every row of a recording, as the exported program in single precision reports it.
///
/// # Errors
/// See [`ExportError`].
pub fn replay(params: &SensorParams, plan: &Plan, dt_s: f64, rows: &[ReplayedRow]) -> Result<Vec<Said>, ExportError> {
    let filter = ChipFilter::new(params, plan)?;
    with_sizes!(params.law.branches.len(), B, N, L => of::<B, N, L>(params, &filter, dt_s, rows))
        .unwrap_or_else(|| Err(too_many_branches()))
}

fn of<const B: usize, const N: usize, const L: usize>(
    params: &SensorParams,
    filter: &ChipFilter,
    dt_s: f64,
    rows: &[ReplayedRow],
) -> Result<Vec<Said>, ExportError> {
    let sensor = FixedRate::<B, N>::new::<L>(params, filter, dt_s as f32)?;
    let replay = Replay { rest_reading: sensor.rest_reading, rows };
    with_twin::<_, B, N, L, _>(&sensor, sensor.model, sensor.interpolated(), replay)
}

struct Replay<'a> {
    rest_reading: f32,
    rows: &'a [ReplayedRow],
}

impl<T: Real> Task<T> for Replay<'_> {
    type Said = Vec<Said<T>>;

    fn run<F, const N: usize, const L: usize>(
        self,
        mut live: LiveFilter<'_, T, Twin<'_, T, F>, N, L>,
    ) -> Result<Vec<Said<T>>, StepError>
    where
        F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>,
    {
        let said = |row: &ReplayedRow| {
            let reading = (!row.reading.is_nan()).then_some(row.reading as f32);
            let reading = relative(self.rest_reading, &Input { reading, reading_sd: row.reading_sd as f32 });
            let LiveEstimate { strain, flags, .. } = live.step_after(T::of(row.since_s.into()), reading)?;
            Ok(Said { strain: strain.mean, sd: strain.sd(), flags: bits(flags) })
        };
        self.rows.iter().map(said).collect()
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain::Sensor;
    use ohmstrain_calib::{EstimatorKind, SensorParams};
    use ohmstrain_ekf::live::{LiveFilter, SensorEstimator};
    use ohmstrain_ekf::{Gaussian, StepError};

    use super::{ChipFilter, FixedRate, Plan, Replay, ReplayedRow, Said, StepNumbers, Task, Twin, with_twin};

    /// A sensor and a recording of its law's own readings, at times that jitter.
    fn sensor() -> Sensor {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/representative.toml");
        Sensor::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap()
    }

    fn rows(params: &SensorParams) -> Vec<ReplayedRow> {
        let law = params.law.to_model::<2>().unwrap();
        let dt_s = |k: u32| 0.05 + 0.03 * (1.7 * f64::from(k)).sin();
        let mut time_s = 0.0;
        let row = |k: u32| {
            let since_s = dt_s(k) as f32;
            time_s += f64::from(since_s);
            let strain = 0.5 * params.limits.span() * (1.0 - (0.9 * time_s).cos());
            let rho = law.gauge_value_and_slope(strain).0 + 1e-3 * (5.3 * f64::from(k)).sin();
            ReplayedRow { since_s, reading: params.rest_reading * (1.0 + rho), reading_sd: 0.0 }
        };
        (0..1500).map(row).collect()
    }

    /// Rested on another day, with another R₀: what the filter that is told so says, started at zero. Rounding counts more while
    /// hypotheses begin to part, and the more the shorter the correction's length scales are (up to an eighth of what all inputs
    /// shared once, when rows were within 0.01 of a deviation); a start that is not known would make the deviation 60 times what it is.
    #[test]
    fn a_twin_that_starts_again_at_zero_is_the_librarys_filter_that_starts_there() {
        let (sensor, another_day) = (sensor(), 1.08);
        let params = sensor.params();
        let rested = another_day * params.measured_rest.unwrap();
        let rows = rows(params);
        let parts = ChipFilter::new(params, &Plan::default()).unwrap();
        let fixed = FixedRate::<2, 5>::new::<15>(params, &parts, 0.05).unwrap();
        let elsewhere = ElsewhereAfter { rows: &rows, rest_reading: params.rest_reading, another_day, rested };
        let said = with_twin::<_, 2, 5, 15, _>(&fixed, fixed.reference, fixed.exact(), elsewhere).unwrap();
        let mut filter = sensor.filter().rest_resistance(rested).initial_strain(0.0).build().unwrap();
        // They begin at rest.
        for (k, (row, said)) in rows.iter().zip(said).enumerate() {
            let expected = filter.step(0.05 * k as f64, another_day * row.reading).unwrap();
            let off = (said.mean - expected.strain).abs().max((said.sd() - expected.strain_sd).abs());
            assert!(off < 0.02 * expected.strain_sd, "{k}: {said:?} {expected:?}");
        }
    }

    /// A twin that has run for a while, and rests on another day.
    struct ElsewhereAfter<'a> {
        rows: &'a [ReplayedRow],
        rest_reading: f64,
        another_day: f64,
        rested: f64,
    }

    impl Task<f64> for ElsewhereAfter<'_> {
        type Said = Vec<Gaussian<f64>>;

        fn run<F, const N: usize, const L: usize>(
            self,
            mut live: LiveFilter<'_, f64, Twin<'_, f64, F>, N, L>,
        ) -> Result<Vec<Gaussian<f64>>, StepError>
        where
            F: SensorEstimator<f64, N, L, Prepared = F> + StepNumbers<f64>,
        {
            for row in &self.rows[..SETTLED] {
                live.step_after(0.05, Some((row.reading / self.rest_reading - 1.0).into()))?;
            }
            live.rezero(self.rested)?;
            // The first row of a recording takes no time.
            let said = |(k, row): (usize, &ReplayedRow)| {
                let reading = live.relative(self.another_day * row.reading, 0.0);
                live.step_after(if k > 0 { 0.05 } else { 0.0 }, Some(reading)).map(|said| said.strain)
            };
            self.rows.iter().enumerate().map(said).collect()
        }
    }

    /// The first step of a chip takes an interval, the first row of a recording none: after so many rows that is forgotten.
    const SETTLED: usize = 600;

    /// The twin in double precision is the filter of the library: readings and limits rounded to 6e-8 move what it says by no
    /// more than a hundred times that.
    #[test]
    fn the_twin_in_double_precision_is_the_librarys_filter() {
        let sensor = sensor();
        let params = sensor.params();
        let mut worst = 0.0_f64;
        // On another day R₀ follows.
        for (kind, day) in [
            (EstimatorKind::Corrected, 1.0),
            (params.filter_of(EstimatorKind::Corrected), 1.0),
            (EstimatorKind::Corrected, 1.4),
        ] {
            let another_day = |row: ReplayedRow| ReplayedRow { reading: day * row.reading, ..row };
            let rows: Vec<ReplayedRow> = rows(params).into_iter().map(another_day).collect();
            let parts = ChipFilter::new(params, &Plan { kind: Some(kind), ..Plan::default() }).unwrap();
            let fixed = FixedRate::<2, 5>::new::<15>(params, &parts, 0.05).unwrap();
            let replay = Replay { rest_reading: fixed.rest_reading, rows: &rows };
            let twin: Vec<Said<f64>> =
                with_twin::<_, 2, 5, 15, _>(&fixed, fixed.reference, fixed.exact(), replay).unwrap();
            let mut filter = sensor.filter().estimator(kind).build().unwrap();
            let (mut largest, mut time_s) = (0.0_f64, 0.0);
            for (k, (row, said)) in rows.iter().zip(twin).enumerate() {
                time_s += f64::from(row.since_s);
                let expected = filter.step(time_s, row.reading).unwrap();
                if k < SETTLED {
                    continue;
                }
                largest = largest.max((said.strain - expected.strain).abs()).max((said.sd - expected.strain_sd).abs());
            }
            println!("{}, {day}: {largest:.1e}", kind.name());
            worst = worst.max(largest);
        }
        assert!(worst < 6e-6, "{worst}");
    }
}
