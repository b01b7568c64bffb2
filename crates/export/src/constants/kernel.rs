//! Numbers and arithmetic of the filter's step.

use ohmstrain_ekf::record::{MixtureNumbers, shared};
use ohmstrain_ekf::{
    Compact, Gaussian, Hypotheses, LONGEST_PAUSE_S, STEP_EVENLY, STEP_GRACE, STEP_GROWTH, SignSplit, SparseEkf,
};
use ohmstrain_sensor::{EstimatorKind, HISTORIES, HYPOTHESES};
use serde::Serialize;

use crate::arithmetic::{self, Lists};
use crate::fixed_rate::FixedRate;
use crate::literal::{Literal, literals};
use crate::twin::filter_parts;
use crate::{ExportError, parameter};

/// Constants that depend on the length of a step.
#[derive(Debug, Serialize)]
pub struct StepConstants {
    names: Vec<String>,
    usual_s: Literal,
    longest_s: Literal,
    grace: Literal,
    growth: Literal,
    evenly: Literal,
    longest_pause_s: Literal,
    usual: Vec<Literal>,
    /// The numbers of a step of length zero; `None` is infinite.
    instant: Vec<Option<Literal>>,
    /// The numbers of the whole steps that a pause is divided into.
    whole: Vec<Vec<Literal>>,
    lower_s: Literal,
    upper_s: Literal,
    nodes: Vec<Literal>,
    inverses: Vec<Literal>,
    rows: Vec<Vec<Literal>>,
    /// Reciprocals: name, and name of the denominator.
    reciprocals: Vec<(String, String)>,
}

/// Constants of all filters of hypotheses.
#[derive(Debug, Serialize)]
pub struct SharedConstants {
    least_weight: Literal,
    not_lighter: Literal,
    least_mass: Literal,
}

impl SharedConstants {
    /// Returns the constants that are the same for every sensor.
    pub fn new() -> Self {
        Self {
            least_weight: Literal(shared::LEAST_WEIGHT_KEPT),
            not_lighter: Literal(shared::NOT_LIGHTER),
            least_mass: Literal(shared::LEAST_MASS_LEFT),
        }
    }
}

impl StepConstants {
    /// Returns the constants of a sensor, with the names that the kernel gives them. Constants that the filter does not need
    /// are left out.
    pub fn new<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>, recorded: &Recorded) -> Self {
        let (table, names) = (&sensor.table, &recorded.names);
        let all: Vec<usize> = (0..table.rows[0].len()).collect();
        let kept = recorded.steps.as_ref().unwrap_or(&all);
        let narrow = |numbers: &[f64]| numbers.iter().map(|x| Literal(*x as f32)).collect();
        let of_kept = |numbers: &[f32]| literals(&kept.iter().map(|place| numbers[*place]).collect::<Vec<_>>());
        let at = |step_s: f32| of_kept(&sensor.numbers_at(step_s));
        let finite = |number: f32| number.is_finite().then_some(Literal(number));
        Self {
            names: kept.iter().filter_map(|place| names.get(*place).cloned()).collect(),
            usual_s: Literal(sensor.usual_step_s()),
            longest_s: Literal(sensor.narrow().longest_step_s),
            grace: Literal(STEP_GRACE as f32),
            growth: Literal(STEP_GROWTH as f32),
            evenly: Literal(STEP_EVENLY as f32),
            longest_pause_s: Literal(LONGEST_PAUSE_S as f32),
            usual: at(sensor.usual_step_s()),
            instant: kept.iter().map(|place| finite(sensor.numbers_at(0.0)[*place])).collect(),
            whole: sensor.whole_steps_s().into_iter().map(at).collect(),
            lower_s: Literal(table.range.0 as f32),
            upper_s: Literal(table.range.1 as f32),
            nodes: narrow(&table.nodes),
            inverses: narrow(&table.inverses),
            rows: table.rows.iter().map(|row| kept.iter().map(|place| Literal(row[*place] as f32)).collect()).collect(),
            reciprocals: table.reciprocals.iter().map(|(at, of)| (names[*at].clone(), names[*of].clone())).collect(),
        }
    }
}

/// Constants that the filter in single precision computes itself.
pub struct Recorded {
    /// Functions in C.
    pub arithmetic: String,
    pub numbers: MixtureNumbers,
    /// Names of the values that depend on the length of a step, as in C.
    pub names: Vec<String>,
    /// Indices of those that the filter needs; `None` if it needs all, followed by the probabilities of a chain of phases.
    pub steps: Option<Vec<usize>>,
}

impl Recorded {
    /// Records the kernel of a sensor.
    ///
    /// # Errors
    /// If the filter refuses its numbers.
    pub fn new<const B: usize, const N: usize>(
        sensor: &FixedRate<'_, B, N>,
        lists: Option<&mut Lists>,
    ) -> Result<Self, ExportError> {
        let kernel: SparseEkf<f32, Compact, B, N> =
            SparseEkf::new(sensor.model, sensor.usual_step_s()).map_err(parameter)?;
        let names: Vec<String> = kernel.step_names().iter().map(|name| name.to_uppercase()).collect();
        let carried = SparseEkf::<f32, Compact, B, N>::carried();
        let none = MixtureNumbers {
            fresh: [Gaussian { mean: 0.0, variance: 0.0 }; 3],
            tempering: 1.0,
            forgets_direction_s: f32::INFINITY,
        };
        let record = |piece| kernel.record(piece);
        let Some(phases) = sensor.parts.phases else {
            let steps = Some(arithmetic::steps_of_ekf(carried, record));
            let arithmetic = arithmetic::of_ekf(lists, carried, &names, record);
            return Ok(Self { arithmetic, numbers: none, names, steps });
        };
        let (dwell, evidence) = filter_parts(&phases, sensor.narrow().limits).map_err(parameter)?;
        let splits = sensor.parts.kind == EstimatorKind::SignSplit;
        let numbers = if splits {
            SignSplit::<_, B, N, HYPOTHESES, _>::around(kernel, phases.rests().then_some(dwell), evidence).numbers()
        } else {
            Hypotheses::<_, B, N, HISTORIES, _>::around(kernel, dwell, evidence).numbers()
        };
        let arithmetic = arithmetic::of_hypotheses(splits, carried, &names, record);
        Ok(Self { arithmetic, numbers, names, steps: None })
    }
}
