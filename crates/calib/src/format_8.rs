//! The correction in files of format 8: the rows that it was learned from, without weights.

use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS, FeatureScale, OUTPUTS};
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{CorrectionParams, EstimatorKind, TrainingRow};
use serde::Deserialize;

use crate::calibrate::correction_fit::CorrectorInputs;
use crate::correction::gaussian_process::Settings;
use crate::correction::simulated::Distilled;
use crate::correction::{Choices, Chosen, Prepared};
use ohmstrain_sensor::correction::{ProcessKind, SIDES, SMOOTHER_INPUTS};

/// Table `correction` of a file of format 8.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionOfFormat8 {
    corrects: EstimatorKind,
    readings: FeatureScale<f64>,
    filter: Corrector,
    smoother: Corrector,
    rows: Vec<TrainingRow>,
    simulated: Distilled,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Corrector {
    sd_scale: f64,
    direct: Process,
    residual: Process,
    #[serde(default)]
    one_sided: Vec<Process>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Process {
    lengths: Vec<f64>,
    noise: f64,
    noise_time_s: f64,
    sd_scale: f64,
}

impl CorrectionOfFormat8 {
    /// Learns the weights of the correction; `None` if nothing can be learned from the rows.
    #[must_use]
    pub fn learned(self, limits: StrainRange<f64>) -> Option<CorrectionParams> {
        let Self { corrects, readings, filter, smoother, rows, simulated } = self;
        let inputs = CorrectorInputs::new(&rows);
        let of_filter = Prepared::new(inputs.of_filter(limits));
        let simulated = of_filter.simulated(&simulated)?;
        let filter = filter.choices(FILTER_INPUTS).learned::<_, 0>(&of_filter)?;
        let smoother =
            smoother.choices(SMOOTHER_INPUTS).learned::<_, SIDES>(&Prepared::new(inputs.of_smoother(limits)))?;
        Some(CorrectionParams { corrects, readings, filter, smoother, simulated, rows })
    }
}

impl Corrector {
    fn choices(self, inputs: usize) -> Choices {
        let chosen = |inputs, Process { lengths, noise, noise_time_s, sd_scale }| Chosen {
            inputs,
            settings: Settings { lengths, noise, noise_time_s },
            sd_scale,
        };
        // The process of the future used the reading, too.
        let future = std::iter::once(OUTPUTS).chain(OUTPUTS + FEATURES..inputs).collect();
        let one_sided = self.one_sided.into_iter().zip([ProcessKind::Past.places(inputs), future]);
        Choices {
            sd_scale: self.sd_scale,
            direct: chosen(ProcessKind::Direct.places(inputs), self.direct),
            residual: chosen(ProcessKind::Residual.places(inputs), self.residual),
            one_sided: one_sided.map(|(side, inputs)| chosen(inputs, side)).collect(),
        }
    }
}
