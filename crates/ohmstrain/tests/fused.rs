//! Files of a fusion.

use ohmstrain::{Error, FusedSensor, Reading, Sensor};

fn sensor() -> Sensor {
    Sensor::from_toml(include_str!("../examples/sensor.toml")).unwrap()
}

/// A fusion as version 0.2.0 wrote it, of two channels and without regressions.
const FORMAT_1: &str = "format = 1
made_by = \"ohmstrain 0.2.0\"
sd_scale = 1.5
quantity = \"strain\"
novelty = 4.0
channel_sd = [0.02, 0.02]
error_covariance = [[1.0, 0.5], [0.5, 1.0]]
low_pass_s = [1.0]
regressions = []

[limits]
lower = 0.0
upper = 0.35

[[rows]]
strain = 0.1
ln_r = [0.2, 0.2]
low_passed = [[0.2, 0.2]]
";

/// Two equal members with a correlation of a half leave three quarters of the variance; the file scales the deviation by 1.5.
#[test]
fn a_fusion_of_format_1_fuses_filters_but_no_smoothers() {
    let fused = FusedSensor::from_toml(vec![sensor(), sensor()], FORMAT_1).unwrap();
    assert_eq!((fused.params().format, fused.params().errors.sd_scale), (2, 1.5));
    // What is written is of the present format.
    let again = FusedSensor::from_toml(vec![sensor(), sensor()], &fused.to_toml().unwrap()).unwrap();
    assert_eq!(again.params(), fused.params());
    let mut filter = fused.filter().unwrap();
    let mut alone = sensor().filter().build().unwrap();
    // ln R / R₀ is 0.2 in the only row.
    let reading = sensor().params().rest_reading * 0.2_f64.exp();
    let row = filter.step(0.0, &[reading.into(), reading.into()]).unwrap();
    let one = alone.step(0.0, reading).unwrap();
    assert!((row.strain - one.strain).abs() < 1e-12 && !row.is_unlike, "{row:?}");
    assert!((row.strain_sd - 1.5 * 0.75_f64.sqrt() * one.strain_sd).abs() < 1e-12, "{row:?}");
    let readings: &[Reading] = &[reading.into()];
    let refused = fused.smooth(&[0.0], &[readings, readings]).unwrap_err();
    assert!(matches!(refused, Error::NoFusedSmoother), "{refused}");
    assert_eq!(
        refused.to_string(),
        "expected a fusion of smoothers; calibrate again, with an estimator that has a smoother"
    );
    // Too short, a negative variance, not symmetric, a correlation of one.
    for wrong in ["[[1.0, 0.5]]", "[[-5.0, 0.5], [0.5, 1.0]]", "[[1.0, 0.5], [0.4, 1.0]]", "[[1.0, 1.0], [1.0, 1.0]]"] {
        let text = FORMAT_1.replace("[[1.0, 0.5], [0.5, 1.0]]", wrong);
        let refused = FusedSensor::from_toml(vec![sensor(), sensor()], &text).unwrap_err();
        assert!(refused.to_string().contains("errors.covariance"), "{wrong}: {refused}");
    }
}

/// A fused smoother is that of each channel, weighted; more readings than times are refused.
#[test]
fn smoothers_are_fused_row_by_row() {
    let smoothers = "\n[smoothers]\nsd_scale = 1.0\ncovariance = [[1.0, 0.0], [0.0, 1.0]]\n\n[[rows]]";
    let text = FORMAT_1
        .replace("format = 1", "format = 2")
        .replace("sd_scale = 1.5\n", "")
        .replace("error_covariance = [[1.0, 0.5], [0.5, 1.0]]\n", "")
        .replace("\n[[rows]]", "\n[errors]\nsd_scale = 1.0\ncovariance = [[1.0, 0.0], [0.0, 1.0]]\n\n[[rows]]")
        .replacen("\n[[rows]]", smoothers, 1);
    let fused = FusedSensor::from_toml(vec![sensor(), sensor()], &text).unwrap();
    let rest = sensor().params().rest_reading;
    let time_s: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
    let reading = |k: i32| rest * (0.2 + 0.002 * f64::from(k)).exp();
    let readings: Vec<Reading> = (0..40).map(|k| reading(k).into()).collect();
    let rows = fused.smooth(&time_s, &[&readings, &readings]).unwrap();
    let alone = sensor().filter().smooth_readings(&time_s, &readings).unwrap();
    for (row, one) in rows.iter().zip(&alone).filter(|(row, _)| !row.is_unlike) {
        assert!((row.strain - one.strain).abs() < 1e-12, "{row:?}");
        assert!((row.strain_sd - 0.5_f64.sqrt() * one.strain_sd).abs() < 1e-12, "{row:?}");
    }
    assert!(rows.iter().filter(|row| !row.is_unlike).count() > 10);
    let refused = fused.smooth(&time_s[1..], &[&readings, &readings]).unwrap_err();
    assert!(matches!(refused, Error::Lengths { times: 39, readings: 40 }), "{refused}");
}
