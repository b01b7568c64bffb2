use std::collections::BTreeMap;

use ohmstrain_calib::{
    BranchParams, EstimatorKind, EstimatorParams, GaugeParams, LawParams, MotionParams, NoiseParams, Output, Quantity,
    RangeParams, ReadingUnit, SensorParams, StaticCubic, Uncertainty, Validity,
};
use ohmstrain_ekf::{Estimate, Gaussian, ReadingVerdict};

use super::{ReportInput, ScoreRow, render};

fn sensor() -> SensorParams {
    let range = RangeParams { lower: 0.0, upper: 0.3 };
    let branch = BranchParams {
        tau_s: 20.0,
        extend_gain: 0.4,
        retract_gain: -0.3,
        extend_gain_slope: 0.0,
        retract_gain_slope: 0.0,
    };
    let estimator = EstimatorParams {
        phases: None,
        score: 0.0,
        strain_sd_scale: 1.0,
        smoothed_sd_scale: None,
        motion: MotionParams::OrnsteinUhlenbeck {
            rate_time_s: 2.0,
            rate_sd_per_s: 0.05,
            strain_mean: 0.15,
            strain_sd: 0.1,
        },
        noise: NoiseParams { reading_sd: 1e-3, branch_sd: 0.01, baseline_sd: 0.01, baseline_time_s: 30.0 },
    };
    SensorParams {
        format: ohmstrain_calib::FORMAT,
        made_by: "test".into(),
        quantity: Quantity::Strain,
        reading: ReadingUnit::Ohm,
        rest_reading: 1000.0,
        measured_rest: None,
        default_estimator: EstimatorKind::Ekf,
        limits: range,
        validity: Validity {
            lower: 0.0,
            upper: 0.3,
            reading_lower: 1000.0,
            reading_upper: 1400.0,
            fastest_rate_per_s: 0.1,
            duration_s: 100.0,
            longest_repeat_s: 0.0,
        },
        static_cubic: StaticCubic {
            reading_centre: 1200.0,
            reading_scale: 200.0,
            coefficients: [0.15, 0.1, 0.0, 0.05],
            range,
        },
        joint: None,
        law: LawParams {
            extend_viscosity_s: 0.1,
            retract_viscosity_s: -0.1,
            range,
            gauge: GaugeParams::DecayingExponential { slope: 2.0, decay_strain: 0.2 },
            branches: vec![branch],
        },
        estimators: BTreeMap::from([(EstimatorKind::Ekf, estimator)]),
        recordings: vec![],
        uncertainty: None,
        correction: None,
    }
}

fn output(strain: f64, nis: Option<f64>) -> Output {
    let known = |mean| Gaussian { mean, variance: 1e-4 };
    let estimate = Estimate {
        strain: known(strain),
        rate: known(0.01),
        relaxation: known(0.02),
        baseline: 0.0,
        settled: known(2.0 * strain),
        beyond_border: 0.0,
        near_ramp_border: false,
    };
    Output { estimate, nis, verdict: ReadingVerdict::Accepted, phases: None }
}

fn page(params: &SensorParams, time_s: &[f64], reading: &[f64], truth: Option<&[f64]>, outputs: &[Output]) -> String {
    let input = ReportInput {
        title: "a <b> & \"c\".csv",
        made_by: "ohmstrain 0",
        time_s,
        reading,
        truth,
        filtered: outputs,
        smoothed: outputs,
        params,
        rest_reading: params.rest_reading,
        scored_from_s: time_s.get(time_s.len() / 2).copied(),
        scores: &[ScoreRow {
            name: "<filter>",
            rmse: 0.01,
            rmse_percent_fs: 3.3,
            coverage_95: None,
            width_95_percent_fs: None,
            crps_percent_fs: 2.5,
        }],
    };
    render(&input).unwrap_or_else(|error| panic!("{error}"))
}

/// Ramp, hold, ramp, hold.
fn motion(rows: usize) -> (Vec<f64>, Vec<f64>, Vec<Output>) {
    let time: Vec<f64> = (0..rows).map(|k| 100.0 * k as f64 / rows as f64).collect();
    let strain: Vec<f64> =
        time.iter().map(|t| 0.03 * ((t - 5.0).clamp(0.0, 8.0) - (t - 60.0).clamp(0.0, 8.0))).collect();
    let nis = |k: usize| (!k.is_multiple_of(7)).then_some((k % 5) as f64 * 0.4);
    let outputs = strain.iter().enumerate().map(|(k, x)| output(*x, nis(k))).collect();
    (time, strain, outputs)
}

#[test]
fn names_are_escaped() {
    let (time, strain, outputs) = motion(400);
    let reading: Vec<f64> = strain.iter().map(|x| 1000.0 * (1.0 + x)).collect();
    let page = page(&sensor(), &time, &reading, Some(&strain), &outputs);
    assert!(page.contains("a &lt;b&gt; &amp; &quot;c&quot;.csv"));
    assert!(page.contains("&lt;filter&gt;"));
    assert!(!page.contains("<b>") && !page.contains("<filter>"));
    assert!(page.contains("Relaxation while held"));
    assert!(!page.contains("http://") || !page.replace("http://www.w3.org/2000/svg", "").contains("http"));
    assert!(!page.contains("<script"));
}

#[test]
fn parameters_are_what_the_recordings_tell_or_not_told() {
    let mut sensor = sensor();
    let names = ["gauge.coefficients[0]", "extend_viscosity_s"].map(String::from).to_vec();
    let (values, standard_errors) = (vec![1.8, 0.01], vec![0.1, 0.02]);
    sensor.uncertainty = Some(Uncertainty { names, values, standard_errors, covariance: vec![vec![0.0; 2]; 2] });
    let page = page(&sensor, &[], &[], None, &[]);
    assert!(
        page.contains("1.80 ± 0.10") && page.contains("not told (0.010 ± 0.020)") && page.contains("<td>not told</td>")
    );
    assert!(page.contains("Told by the recordings"));
}

#[test]
fn anything_gives_a_report() {
    let (time, strain, outputs) = motion(300);
    let missing = vec![f64::NAN; time.len()];
    let wild = [f64::NAN, f64::INFINITY, f64::MAX, f64::MIN, 0.0, 1e-320];
    let wild_outputs: Vec<Output> = wild.iter().map(|x| output(*x, Some(*x))).collect();
    let mut angle = sensor();
    (angle.quantity, angle.reading) = (Quantity::AngleDeg, ReadingUnit::Ratio);
    angle.estimators.clear();
    let mut broken = sensor();
    broken.law.range = RangeParams { lower: f64::NAN, upper: f64::NAN };
    broken.law.branches[0].tau_s = 0.0;
    for params in [&sensor(), &angle, &broken] {
        page(params, &[], &[], None, &[]);
        page(params, &[1.0], &[1000.0], None, &outputs[..1]);
        page(params, &[1.0], &[f64::NAN], Some(&[f64::NAN]), &outputs[..1]);
        page(params, &time, &missing, None, &outputs);
        page(params, &time, &missing, Some(&missing), &outputs);
        page(params, &time, &strain, Some(&strain), &[]);
        page(params, &time, &strain[..7], Some(&strain[..90]), &outputs[..50]);
        page(params, &wild, &wild, Some(&wild), &wild_outputs);
        page(params, &wild, &wild, None, &wild_outputs);
    }
}

#[test]
fn what_is_not_there_is_said() {
    let time: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
    let strain: Vec<f64> = time.iter().map(|t| 0.1 + 0.1 * t.sin()).collect();
    let outputs: Vec<Output> = strain.iter().map(|x| output(*x, None)).collect();
    let page = page(&sensor(), &time, &vec![f64::NAN; 200], Some(&strain), &outputs);
    assert!(page.contains("holds still nowhere"));
    assert!(page.contains("There is no reading"));
    assert!(page.contains("200 readings are missing"));
}

#[test]
fn a_long_recording_gives_a_small_file() {
    let (time, strain, outputs) = motion(200_000);
    let noise = |k: usize| ((k * 7919) % 1000) as f64 * 1e-4;
    let reading: Vec<f64> = strain.iter().enumerate().map(|(k, x)| 1000.0 * (1.0 + x + noise(k))).collect();
    let page = page(&sensor(), &time, &reading, Some(&strain), &outputs);
    assert!(page.len() < 2_000_000, "{}", page.len());
}
