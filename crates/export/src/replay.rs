//! Replay of a recording by the exported program's twin.

use ohmstrain_ekf::live::{LiveEstimate, Protections, SensorEstimator};
use ohmstrain_ekf::{Real, StepError};
use ohmstrain_sensor::{SensorParams, with_sizes};

use super::fixed_rate::FixedRate;
use super::plan::{ChipFilter, Plan};
use super::twin::{StepNumbers, Task, TwinFilter, bits, with_twin};
use super::{ExportError, too_many_branches};

/// A row of a recording; a missing reading is NaN.
pub struct ReplayedRow {
    /// Time since the previous row, s; for the first row since the start.
    pub since_s: f32,
    /// The reading, in the sensor's unit.
    pub reading: f64,
    /// Standard deviation that the electronics add, in the same unit.
    pub reading_sd: f64,
}

/// A row as the exported program in single precision reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChipEstimate<T = f32> {
    /// Strain.
    pub strain: T,
    /// Its deviation.
    pub sd: T,
    /// `ohmstrain_flag` in C.
    pub flags: u32,
}

/// Returns every row of a recording as the exported program reports it, in single precision.
///
/// # Errors
/// See [`ExportError`].
pub fn replay(
    params: &SensorParams,
    plan: &Plan,
    dt_s: f64,
    rows: &[ReplayedRow],
) -> Result<Vec<ChipEstimate>, ExportError> {
    replay_from(params, plan, dt_s, None, rows)
}

/// Returns the same for a sensor whose reading at rest was measured.
pub(crate) fn replay_from(
    params: &SensorParams,
    plan: &Plan,
    dt_s: f64,
    rest: Option<f64>,
    rows: &[ReplayedRow],
) -> Result<Vec<ChipEstimate>, ExportError> {
    let filter = ChipFilter::new(params, plan)?;
    with_sizes!(params.law.branches.len(), B, N, L => of::<B, N, L>(params, &filter, dt_s, rest, rows))
        .unwrap_or_else(|| Err(too_many_branches()))
}

fn of<const B: usize, const N: usize, const L: usize>(
    params: &SensorParams,
    filter: &ChipFilter,
    dt_s: f64,
    rest: Option<f64>,
    rows: &[ReplayedRow],
) -> Result<Vec<ChipEstimate>, ExportError> {
    let sensor = FixedRate::<B, N>::new::<L>(params, filter, dt_s as f32)?;
    let replay = Replay { rows, rest, protections: Protections::ALL };
    with_twin::<_, B, N, L, _>(&sensor, sensor.model, sensor.interpolated(), replay)
}

struct Replay<'a> {
    rows: &'a [ReplayedRow],
    rest: Option<f64>,
    protections: Protections,
}

impl<T: Real> Task<T> for Replay<'_> {
    type Output = Vec<ChipEstimate<T>>;

    fn run<F, const N: usize, const L: usize>(
        self,
        live: TwinFilter<'_, T, F, N, L>,
    ) -> Result<Vec<ChipEstimate<T>>, StepError>
    where
        F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>,
    {
        let mut live = live.protected_by(self.protections);
        if let Some(measured) = self.rest {
            live.rest(T::of(f64::from(measured as f32)))?;
        }
        let estimate = |row: &ReplayedRow| {
            let [reading, sd] = [row.reading, row.reading_sd].map(|number| T::of(f64::from(number as f32)));
            let reading = (!row.reading.is_nan()).then(|| live.relative(reading, sd));
            let LiveEstimate { strain, flags, .. } = live.step_after(T::of(row.since_s.into()), reading)?;
            Ok(ChipEstimate { strain: strain.mean, sd: strain.sd(), flags: bits(flags) })
        };
        self.rows.iter().map(estimate).collect()
    }
}

#[cfg(test)]
mod tests;
