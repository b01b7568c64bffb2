//! Properties of every estimator on any recording: units are arbitrary, a missing reading is a prediction, and a step equals
//! two halves.

use nalgebra::{DMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Channel, Dwell, Dynamics, Ekf, Estimator, Evidence, Hypotheses, Imm, Mixture, PhaseMixture, Reading,
    SignSplit, State as _, Step,
};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};
use ohmstrain_tests::{KnownPhase, rts_smooth};
use proptest::prelude::*;

type Sensor = SwitchedModel<f64, 2, 5>;
type State = Belief<f64, 5, 15>;

/// Time since the previous row, s, and a reading relative to R₀.
type Row = (f64, Option<f64>);

/// Implausible readings, hundreds of standard deviations from the expected ones.
fn wild() -> impl Strategy<Value = Vec<Row>> {
    prop::collection::vec((0.005..0.4_f64, prop::option::weighted(0.8, -0.1..0.6_f64)), 1..40)
}

/// Readings of a strain that wanders between 0 and 0.3, a few standard deviations from the expected ones, so that
/// rounding is bounded.
fn tame() -> impl Strategy<Value = Vec<Row>> {
    let row = (0.005..0.4_f64, -0.1..0.1_f64, prop::option::weighted(0.8, -5e-3..5e-3_f64));
    prop::collection::vec(row, 1..40).prop_map(|rows| {
        let mut strain: f64 = 0.15;
        let reading = |(dt_s, rate, noise): (f64, f64, Option<f64>)| {
            strain = (strain + rate * dt_s).clamp(0.0, 0.3);
            (dt_s, noise.map(|noise| 1.6 * strain - 1.2 * strain * strain + noise))
        };
        rows.into_iter().map(reading).collect()
    })
}

/// Units: strains are in units of `1/strain`, readings in units of `R₀/reading`.
#[derive(Clone, Copy, Debug)]
struct Units {
    strain: f64,
    reading: f64,
}

const PLAIN: Units = Units { strain: 1.0, reading: 1.0 };

impl Units {
    /// Returns the factors on a state: strain, rate, two branches, baseline.
    fn of_state(self) -> SVector<f64, 5> {
        SVector::from([self.strain, self.strain, self.reading, self.reading, self.reading])
    }

    fn law(self, gain_slope: f64) -> SensorLaw<f64, 2> {
        let Self { strain, reading } = self;
        let per_strain = reading / strain;
        let branch = |tau_s: f64| Branch {
            tau_s,
            extend_gain: 0.8 * per_strain,
            retract_gain: -0.5 * per_strain,
            extend_gain_slope: -gain_slope * per_strain / strain,
            retract_gain_slope: 0.7 * gain_slope * per_strain / strain,
        };
        let coefficients = [1.6 * per_strain, -1.2 * per_strain / strain, 0.5 * per_strain / strain / strain];
        SensorLaw {
            gauge: Gauge::Polynomial { coefficients },
            extend_viscosity_s: 0.02 * per_strain,
            retract_viscosity_s: -0.01 * per_strain,
            branches: [branch(3.0), branch(40.0)],
            range: StrainRange { lower: -0.02 * strain, upper: 0.35 * strain },
        }
    }

    fn noise(self) -> ModelNoise<f64> {
        let Self { reading, .. } = self;
        ModelNoise {
            reading_sd: 2e-3 * reading,
            branch_sd: 5e-3 * reading,
            baseline_sd: 0.02 * reading,
            baseline_time_s: 30.0,
        }
    }

    fn sensor(self) -> Sensor {
        let Self { strain, .. } = self;
        let motion = Motion::ornstein_uhlenbeck(1.5, 0.05 * strain, 0.15 * strain, 0.1 * strain).unwrap();
        SwitchedModel::new(self.law(0.6), motion.with_phase_rate(0.05 * strain).unwrap(), self.noise()).unwrap()
    }

    fn evidence(self) -> Evidence<f64> {
        Evidence { limits: self.law(0.6).range, tempering: 0.8 }
    }

    fn reading(self, reading: Option<f64>) -> Option<Reading<f64>> {
        reading.map(|y| Reading { value: y * self.reading, extra_variance: 1e-6 * self.reading * self.reading })
    }

    fn back(self, belief: &State) -> State {
        let mut plain = *belief;
        let scale = self.of_state();
        plain.mean.component_div_assign(&scale);
        for i in 0..5 {
            for j in 0..=i {
                plain.covariance[(i, j)] /= scale[i] * scale[j];
            }
        }
        plain
    }
}

/// Returns filtered and smoothed beliefs in plain units.
fn one_gaussian<M: Dynamics<f64, 5, 15> + Channel<f64, 5, 15>>(
    filter: impl Fn(Sensor) -> Ekf<M>,
    units: Units,
    rows: &[Row],
) -> Vec<State> {
    let sensor = units.sensor();
    let steps = run(&filter(sensor), Belief::initial(&sensor), rows, |reading| units.reading(reading));
    let smoothed = rts_smooth(&steps);
    steps.iter().map(|step| &step.posterior).chain(&smoothed).map(|belief| units.back(belief)).collect()
}

fn run<M: Dynamics<f64, N, L> + Channel<f64, N, L>, const N: usize, const L: usize>(
    filter: &Ekf<M>,
    start: Belief<f64, N, L>,
    rows: &[Row],
    in_units: impl Fn(Option<f64>) -> Option<Reading<f64>>,
) -> Vec<Step<f64, N, L>> {
    let mut belief = start;
    let step = |(dt_s, reading): &Row| {
        let step = filter.step(&belief, *dt_s, in_units(*reading)).unwrap();
        belief = step.posterior;
        step
    };
    rows.iter().map(step).collect()
}

/// Returns moments and phase probabilities of a filter of hypotheses, in plain units.
fn mixture<E: Estimator<f64, 5, 15>>(
    units: Units,
    rows: &[Row],
    filter: &E,
    start: E::State,
) -> Vec<(State, [f64; 3])> {
    let mut state = start;
    let step = |(dt_s, reading): &Row| {
        state = filter.advance(&state, &filter.prepare(*dt_s), units.reading(*reading)).unwrap().state;
        (units.back(&state.moments()), state.phases().unwrap())
    };
    rows.iter().map(step).collect()
}

/// Returns the results of all three filters of hypotheses, one after the other.
fn mixtures(units: Units, rows: &[Row]) -> Vec<(State, [f64; 3])> {
    let (sensor, evidence, dwell) = (units.sensor(), units.evidence(), Dwell::new(2.0, 1.0, 0.3).unwrap());
    let start: Belief<f64, 5, 15> = Belief::initial(&sensor);
    let imm = Imm::<f64, 2, 5>::new(sensor, 0.0, dwell, evidence).unwrap();
    let split = SignSplit::<f64, 2, 5, 8>::new(sensor, 0.0, Some(dwell), evidence).unwrap();
    let histories = Hypotheses::<f64, 2, 5, 16>::new(sensor, 0.0, dwell, evidence).unwrap();
    let mut all = mixture(units, rows, &imm, PhaseMixture::single(start, Phase::Extend));
    all.extend(mixture(units, rows, &split, Mixture::single(start, Phase::Extend)));
    all.extend(mixture(units, rows, &histories, Mixture::single(start, Phase::Extend)));
    all
}

/// True if two beliefs agree within a fraction of the standard deviations.
fn alike<const N: usize, const L: usize>(a: &Belief<f64, N, L>, b: &Belief<f64, N, L>, tolerance: f64) -> bool {
    let sd = |i: usize| b.covariance[(i, i)].sqrt();
    (0..N).all(|i| {
        (a.mean[i] - b.mean[i]).abs() <= tolerance * sd(i)
            && (0..N).all(|j| (a.covariance[(i, j)] - b.covariance[(i, j)]).abs() <= tolerance * sd(i) * sd(j))
    })
}

/// 2⁻³⁰ is about 1e-9. Powers of two scale every number without rounding, so no bit may change; any absolute scale in the
/// code becomes visible.
const STRAIN_UNITS: [f64; 3] = [1.0 / 1_073_741_824.0, 128.0, 1_048_576.0];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn units_do_not_matter_to_filters_and_smoothers_of_one_gaussian(rows in wild()) {
        for strain in STRAIN_UNITS {
            for reading in [1.0, 1.0 / 1_073_741_824.0, 1024.0] {
                let units = Units { strain, reading };
                prop_assert_eq!(one_gaussian(Ekf::new, units, &rows), one_gaussian(Ekf::new, PLAIN, &rows));
            }
        }
    }

    #[test]
    fn units_of_strain_do_not_matter_to_mixtures(rows in wild()) {
        let plain = mixtures(PLAIN, &rows);
        for strain in STRAIN_UNITS {
            prop_assert_eq!(&mixtures(Units { strain, reading: 1.0 }, &rows), &plain);
        }
    }

    /// The unit of the reading adds a constant of up to 21 to every log-likelihood, which normalisation removes; the
    /// log-likelihoods themselves are at most of order 100. Over 40 rows that leaves a relative error of 40 · 121 · ε =
    /// 1e-12 in a weight. Hypotheses a few standard deviations apart carry it into the moments, and the filter's memory
    /// adds up a few dozen of those.
    #[test]
    fn units_of_readings_do_not_matter_to_mixtures(rows in tame()) {
        let plain = mixtures(PLAIN, &rows);
        for reading in [1.0 / 1_073_741_824.0, 1024.0] {
            for ((belief, phases), (expected, expected_phases)) in
                mixtures(Units { strain: 1.0, reading }, &rows).iter().zip(&plain)
            {
                prop_assert!(alike(belief, expected, 1e-10));
                for (p, expected) in phases.iter().zip(expected_phases) {
                    prop_assert!((p - expected).abs() < 1e-10);
                }
            }
        }
    }

    /// The future carries no information on the past without readings; rounding as in
    /// `check_split`.
    #[test]
    fn missing_everywhere_is_prediction(rows in wild()) {
        let sensor = PLAIN.sensor();
        let missing = |_: Option<f64>| None;
        let steps = run(&Ekf::new(sensor), Belief::initial(&sensor), &rows, missing);
        let mut belief: State = Belief::initial(&sensor);
        for (step, (dt_s, _)) in steps.iter().zip(&rows) {
            let transition = Dynamics::transition(&sensor, &sensor.prepare(*dt_s), &belief, None);
            belief = Belief { mean: transition.mean, covariance: sensor.propagate(&belief.covariance, &transition) };
            prop_assert_eq!(step.posterior, belief);
        }
        let least = steps.iter().map(|step| least_share(&step.prior)).fold(1.0, f64::min);
        let tolerance = (rows.len() * 25) as f64 * f64::EPSILON / least;
        for (smoothed, step) in rts_smooth(&steps).iter().zip(&steps) {
            prop_assert_eq!(smoothed.mean, step.posterior.mean);
            prop_assert!(alike(smoothed, &step.posterior, tolerance), "{tolerance}");
        }
    }

    /// A row without a reading in the middle of a step changes nothing, with the phase known and constant gains, before
    /// or after smoothing.
    #[test]
    fn splitting_a_step_changes_nothing(rows in tame(), share in 0.01..0.99_f64) {
        let (law, noise) = (PLAIN.law(0.0), PLAIN.noise());
        let rough = Motion::ornstein_uhlenbeck(1.5, 0.05, 0.15, 0.1).unwrap().with_phase_rate(0.05).unwrap();
        for phase in Phase::ALL {
            check_split(&SwitchedModel::new(law, rough, noise).unwrap(), phase, &rows, share)?;
        }
    }
}

/// Checks with a tolerance for rounding. If a direction has only the share p of its variance left, a gain has an error of
/// ε/p, with N² products each, at every row; p is measured.
fn check_split(sensor: &SwitchedModel<f64, 2, 5>, phase: Phase, rows: &[Row], share: f64) -> Result<(), TestCaseError> {
    let start: Belief<f64, 5, 15> = Belief::initial(sensor);
    let halves: Vec<Row> =
        rows.iter().flat_map(|(dt_s, reading)| [(dt_s * share, None), (dt_s * (1.0 - share), *reading)]).collect();
    let model = KnownPhase { model: *sensor, phase };
    let plain = |reading| PLAIN.reading(reading);
    let (whole, split) = (run(&Ekf::new(model), start, rows, plain), run(&Ekf::new(model), start, &halves, plain));
    let (smoothed, smoothed_split) = (rts_smooth(&whole), rts_smooth(&split));
    let least = split.iter().map(|step| least_share(&step.prior)).fold(1.0, f64::min);
    let tolerance = rows.len() as f64 * 25.0 * f64::EPSILON / least;
    for k in 0..rows.len() {
        prop_assert!(alike(&split[2 * k + 1].posterior, &whole[k].posterior, tolerance), "{phase:?}, row {k}");
        prop_assert!(alike(&smoothed_split[2 * k + 1], &smoothed[k], tolerance), "{phase:?}, smoothed, row {k}");
    }
    Ok(())
}

/// Returns the smallest eigenvalue of the correlations of states not exactly known.
fn least_share<const N: usize, const L: usize>(belief: &Belief<f64, N, L>) -> f64 {
    let uncertain: Vec<usize> = (0..N).filter(|&i| belief.covariance[(i, i)] > 0.0).collect();
    let sd = |i: usize| belief.covariance[(uncertain[i], uncertain[i])].sqrt();
    let size = uncertain.len();
    DMatrix::from_fn(size, size, |i, j| belief.covariance[(uncertain[i], uncertain[j])] / sd(i) / sd(j))
        .symmetric_eigenvalues()
        .min()
}
