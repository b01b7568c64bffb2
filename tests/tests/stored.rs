//! Stored or sent values are restored unchanged: feature `serde` of model and filters.

use std::fmt::Debug;

use ohmstrain_ekf::{
    Belief, Ekf, Estimate, Evidence, Gaussian, Influence, Innovation, Reading, ReadingVerdict, Real, Residual,
    Settling, StepError, Streak,
};
use ohmstrain_model::{
    AdcCode, Gauge, ModelNoise, Ohms, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
};
use ohmstrain_tests::sensor;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Converts a value to JSON and back.
fn returned<V: Serialize + DeserializeOwned>(value: &V) -> V {
    serde_json::from_str(&serde_json::to_string(value).unwrap()).unwrap()
}

fn returns<V: Serialize + DeserializeOwned + PartialEq + Debug>(value: V) {
    assert_eq!(returned(&value), value);
}

/// Returns a belief after some readings, whose numbers have no short decimal form.
fn belief<T: Scalar>(ekf: &Ekf<SwitchedModel<T, 3, 6>>) -> Belief<T, 6, 21> {
    (0..30).fold(Belief::initial(ekf.model()), |belief, k| {
        let reading = Reading { value: T::of(0.004 * f64::from(k)), extra_variance: T::of(1e-7) };
        ekf.step(&belief, T::of(0.013), Some(reading)).unwrap().posterior
    })
}

fn everything_returns<T: Real + Serialize + DeserializeOwned>() {
    let model = sensor::<T, 3, 6>();
    let ekf = Ekf::new(model);
    let belief = belief(&ekf);
    let third = T::one() / T::of(3.0);

    returns(*model.law());
    returns(*model.noise());
    returns(Gauge::DecayingExponential { slope: third, decay_strain: third });
    returns(Gauge::Tunnelling { gap: third, barrier: -third, path_loss: T::zero() });
    returns(AdcCode::Reading(Ohms { resistance_ohm: third, sd_ohm: third }));
    returns(AdcCode::<T>::Saturated);

    returns(belief);
    let settling = Settling { horizon_s: third, share: third, share_sd: third, sd: third };
    returns(settling);
    returns(Estimate::new(&model, &belief, &model.law().range, third, &settling));
    returns(Evidence { limits: model.law().range, tempering: third });
    returns(Residual { innovation: third, variance: third, nis: third });
    returns(Innovation { value: third, variance: third, nis: third, log_likelihood: -third });
    returns(Influence::Huber { threshold: third });
    returns((ReadingVerdict::Readmitted, Streak::default(), StepError::NonFiniteReading, Phase::Retract));
}

#[test]
fn values_return_in_f32() {
    everything_returns::<f32>();
}

#[test]
fn values_return_in_f64() {
    everything_returns::<f64>();
}

#[test]
fn a_filter_goes_on_from_what_was_stored() {
    let model = sensor::<f32, 3, 6>();
    let stored = SwitchedModel::new(returned(model.law()), *model.motion(), returned(model.noise())).unwrap();
    let (ekf, restored) = (Ekf::new(model), Ekf::new(stored));
    let belief = belief(&ekf);
    let reading = Some(Reading::from(0.12));
    let step = ekf.step(&belief, 0.01, reading).unwrap();
    assert_eq!(restored.step(&returned(&belief), 0.01, reading).unwrap(), step);
}

#[test]
fn names_in_the_text_are_those_in_the_code() {
    let belief = Belief::<f64, 2, 3>::independent([0.25, 0.5].into(), &[1.0, 2.0]);
    assert_eq!(serde_json::to_string(&belief).unwrap(), r#"{"mean":[0.25,0.5],"covariance":[1.0,0.0,2.0]}"#);
    assert_eq!(
        serde_json::to_string(&Gaussian { mean: 0.5, variance: 2.0 }).unwrap(),
        r#"{"mean":0.5,"variance":2.0}"#
    );
}

#[test]
fn what_is_no_value_is_refused() {
    let no = |text: &str| {
        assert!(serde_json::from_str::<Symmetric<f64, 2, 3>>(text).is_err(), "{text}");
    };
    no("[1.0, 0.0]");
    no("[1.0, 0.0, 1.0, 0.0]");
    // JSON has no NaN; it is written as null, which is not a number.
    no(&serde_json::to_string(&[f64::NAN, 0.0, 1.0]).unwrap());
    let noise = r#"{"reading_sd":0.002,"branch_sd":0.005,"baseline_sd":0.02}"#;
    assert!(serde_json::from_str::<ModelNoise<f64>>(noise).is_err());

    // A well-formed but invalid law is rejected by the model, like every invalid law.
    let model = sensor::<f64, 1, 4>();
    let mut text = serde_json::to_value(model.law()).unwrap();
    text["branches"][0]["tau_s"] = (-1.0).into();
    let law: SensorLaw<f64, 1> = serde_json::from_value(text).unwrap();
    let refused = SwitchedModel::<f64, 1, 4>::new(law, *model.motion(), *model.noise()).unwrap_err();
    assert_eq!(refused.parameter, "tau_s");
    assert!(serde_json::from_str::<SensorLaw<f64, 2>>(&serde_json::to_string(model.law()).unwrap()).is_err());
    returns(StrainRange { lower: -0.02, upper: 0.35 });
}
