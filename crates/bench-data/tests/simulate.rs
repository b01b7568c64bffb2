//! Seeds, settings, disturbances and properties of the recordings.

use ohmstrain_bench_data::pacing::{PacedStep, Pacing, Position};
use ohmstrain_bench_data::simulate::{
    Disturbances, Followed, Material, Person, Protocol, SettingsError, SimulationSettings, simulate,
};
use ohmstrain_bench_data::{FrontEndSpec, ReadingKind, ReferenceQuantity, Trace, segment};
use ohmstrain_model::Phase::{self, Extend, Hold, Retract};

fn settings(protocol: Protocol) -> SimulationSettings {
    SimulationSettings::new(Material::Ecoflex0030, protocol)
}

fn bytes(settings: &SimulationSettings) -> Vec<u8> {
    let mut file = Vec::new();
    simulate(settings).unwrap().write(&mut file).unwrap();
    file
}

fn strain(trace: &Trace) -> &[f64] {
    &trace.reference.as_ref().unwrap().values
}

const SHORT_HOLD: Protocol = Protocol::ExtendHold { cycles: 1, hold_s: 20.0, rest_s: 5.0 };

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_does_not() {
    for protocol in [SHORT_HOLD, Protocol::Mixed { duration_s: 60.0 }] {
        for mismatched in [false, true] {
            let first = SimulationSettings { mismatched, ..settings(protocol) };
            assert_eq!(bytes(&first), bytes(&first.clone()));
            assert_ne!(bytes(&first), bytes(&SimulationSettings { seed: 2, ..first.clone() }));
        }
    }
}

#[test]
fn a_recording_survives_its_file() {
    let front_end: FrontEndSpec = "divider reference_ohm=2000 side=high bits=12 noise_codes=0.5".parse().unwrap();
    for front_end in [None, Some(front_end)] {
        let trace = simulate(&SimulationSettings { front_end, ..settings(SHORT_HOLD) }).unwrap();
        let mut file = Vec::new();
        trace.write(&mut file).unwrap();
        assert_eq!(Trace::read(file.as_slice(), "t.csv").unwrap(), trace);
    }
}

#[test]
fn recordings_say_what_they_are() {
    let trace = simulate(&settings(SHORT_HOLD)).unwrap();
    assert_eq!(trace.metadata.material.as_deref(), Some("ecoflex-00-30"));
    assert_eq!(trace.metadata.gauge_length_mm, Some(30.0));
    assert_eq!(
        (trace.readings.kind, trace.reference.as_ref().unwrap().quantity),
        (ReadingKind::Ohm, ReferenceQuantity::Strain)
    );
    // 2 s of rest, 10 s of ramp, 20 s of hold, 10 s of release, 5 s of rest at 20 Hz, both ends included.
    assert_eq!((trace.len(), trace.time_s[940]), (941, 47.0));
    assert_eq!(strain(&trace)[240], 0.33333);
}

#[test]
fn protocols_have_the_phases_they_promise() {
    let cycles = Protocol::ExtendRetract { cycles: 2, rest_s: 10.0 };
    let hold = Protocol::ExtendHold { cycles: 1, hold_s: 60.0, rest_s: 10.0 };
    let loads = Protocol::LoadSteps { step_g: 25.0, hold_s: 20.0 };
    let expected: [(Protocol, &[Phase]); 3] = [
        (cycles, &[Hold, Extend, Retract, Extend, Retract, Hold]),
        (hold, &[Hold, Extend, Hold, Retract, Hold]),
        (loads, &[Hold, Extend, Hold, Extend, Hold, Extend, Hold]),
    ];
    for (protocol, expected) in expected {
        let trace = simulate(&settings(protocol)).unwrap();
        let found: Vec<Phase> = segment(&trace.time_s, strain(&trace)).iter().map(|segment| segment.phase).collect();
        assert_eq!(found, expected, "{protocol}");
    }
}

#[test]
fn long_holds_begin_at_full_stretch_and_vary() {
    let long = Protocol::LongHolds { cycles: 4, hold_s: 100.0, rest_s: 50.0 };
    let trace = simulate(&settings(long)).unwrap();
    let segments = segment(&trace.time_s, strain(&trace));
    let phases: Vec<Phase> = segments.iter().map(|segment| segment.phase).collect();
    assert_eq!(phases, [vec![Hold], [Extend, Hold, Retract, Hold].repeat(4)].concat());
    let held: Vec<f64> = (0..4).map(|cycle| strain(&trace)[segments[2 + 4 * cycle].rows.start + 5]).collect();
    // 10 mm on 30 mm, to the reference's 1e-5; then 40 % of it or more.
    assert!((held[0] - 1.0 / 3.0).abs() <= 1e-5, "{held:?}");
    assert!(held[1..].iter().all(|held| (0.4 / 3.0..1.0 / 3.0).contains(held)), "{held:?}");
    assert!(held.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 1e-3), "{held:?}");
}

#[test]
fn the_mixed_protocol_shows_each_half_the_whole_range_and_every_phase() {
    for speed_mm_s in [1.0, 5.0] {
        let trace = simulate(&SimulationSettings { speed_mm_s, ..settings(Protocol::MIXED) }).unwrap();
        assert_eq!(trace.time_s.last(), Some(&400.0));
        let middle = trace.time_s.partition_point(|time_s| *time_s < 200.0);
        for half in [trace.rows(0..middle), trace.rows(middle..trace.len())] {
            let largest = strain(&half).iter().copied().fold(0.0, f64::max);
            assert!(largest > 0.33);
            let segments = segment(&half.time_s, strain(&half));
            for phase in Phase::ALL {
                let rows: usize = segments.iter().filter(|s| s.phase == phase).map(|s| s.rows.len()).sum();
                assert!(rows * 10 > half.len(), "{phase:?} {rows}");
            }
        }
    }
}

#[test]
fn the_sensor_does_not_depend_on_the_rate_of_the_recording() {
    for mismatched in [false, true] {
        let at = |sample_rate_hz: f64| {
            let disturbances = Disturbances::NONE;
            simulate(&SimulationSettings { sample_rate_hz, disturbances, mismatched, ..settings(SHORT_HOLD) }).unwrap()
        };
        let (coarse, fine) = (at(4.0), at(1000.0));
        for i in 0..coarse.len() {
            let difference = coarse.readings.values[i] - fine.readings.values[250 * i];
            // Two roundings to 1 mΩ, and gains at mid-strain over 10 ms steps, which add 1e-6 of R.
            assert!(difference.abs() < 4e-3, "{i} {difference}");
        }
    }
}

#[test]
fn disturbances_have_the_sizes_they_are_asked_for() {
    let quiet = SimulationSettings { disturbances: Disturbances::NONE, ..settings(SHORT_HOLD) };
    let clean = simulate(&quiet).unwrap().readings.values;
    let white_sd = 2e-4;
    let noisy = SimulationSettings { disturbances: Disturbances { white_sd, ..Disturbances::NONE }, ..quiet.clone() };
    let noisy = simulate(&noisy).unwrap().readings.values;
    let square: f64 = clean.iter().zip(&noisy).map(|(a, b)| ((a - b) / 1600.0).powi(2)).sum();
    // 941 samples: their standard deviation scatters by 1/√1882 = 2.3 %.
    assert!(((square / clean.len() as f64).sqrt() / white_sd - 1.0).abs() < 0.08);

    let cycles = settings(Protocol::ExtendRetract { cycles: 5, rest_s: 0.0 });
    let of = |conditioning: bool| {
        let disturbances = Disturbances { conditioning, ..Disturbances::NONE };
        simulate(&SimulationSettings { disturbances, ..cycles.clone() }).unwrap().readings.values
    };
    let (with, without) = (of(true), of(false));
    for (cycle, change) in [(0, 0.0), (1, -0.019), (2, -0.034), (3, -0.044), (4, -0.047), (5, -0.047)] {
        let row = 40 + 400 * cycle;
        assert!((with[row] / without[row] - 1.0 - change).abs() < 1e-5, "{cycle}");
    }
}

#[test]
fn a_front_end_quantises_and_saturates() {
    let spec = |text: &str| Some(text.parse::<FrontEndSpec>().unwrap());
    let coarse = SimulationSettings {
        front_end: spec("divider reference_ohm=2000 side=low bits=10"),
        disturbances: Disturbances::NONE,
        ..settings(SHORT_HOLD)
    };
    let trace = simulate(&coarse).unwrap();
    let exact = simulate(&SimulationSettings { front_end: None, ..coarse.clone() }).unwrap();
    let converter = trace.readings.converter.unwrap();
    for i in 0..exact.len() {
        let error = (trace.readings.values[i] - exact.readings.values[i]) / converter.sd_ohm[i];
        // The rounding error is at most half a code, √3 of its standard deviation; the divider's nonlinearity is 0.1 %.
        assert!(error.abs() < 1.75, "{error}");
    }
    let narrow = spec("constant-current current_a=1e-4 gain=10 full_scale_v=2.0 bits=12 noise_codes=0.5");
    let trace = simulate(&SimulationSettings { front_end: narrow, ..settings(SHORT_HOLD) }).unwrap();
    let saturated = trace.readings.converter.unwrap().saturated;
    assert!(saturated[240] && !saturated[0] && trace.readings.values[240].is_nan());
}

#[test]
fn loads_and_strains_are_inverse_to_each_other() {
    for material in Material::ALL {
        for load_g in [0.0, 1.0, 40.0, 75.0, 300.0] {
            let strain = material.strain_under_load(load_g);
            assert!((material.load_g(strain) - load_g).abs() < 1e-9 * (1.0 + load_g));
        }
        // The 100 % modulus is the stress at ε = 1, on 17.5 mm².
        let newton = material.modulus_100_mpa() * 17.5;
        assert!((material.load_g(1.0) * 9.80665e-3 / newton - 1.0).abs() < 1e-12);
    }
}

#[test]
fn impossible_settings_are_named() {
    let message = |change: fn(&mut SimulationSettings)| {
        let mut settings = settings(SHORT_HOLD);
        change(&mut settings);
        simulate(&settings).unwrap_err().to_string()
    };
    assert_eq!(message(|s| s.speed_mm_s = f64::NAN), "speed_mm_s: expected 0.01 to 100, found NaN");
    assert_eq!(message(|s| s.elongation_mm = 40.0), "elongation_mm: expected 0.001 to 15, found 40");
    assert_eq!(message(|s| s.sample_rate_hz = 0.0), "sample_rate_hz: expected 0.1 to 10000, found 0");
    assert_eq!(
        message(|s| s.protocol = Protocol::ExtendRetract { cycles: 0, rest_s: 1.0 }),
        "cycles: expected 1 to 10000, found 0"
    );
    assert!(message(|s| s.protocol = Protocol::Mixed { duration_s: 1e6 }).starts_with("number of rows"));
}

#[test]
fn names_are_read_back() {
    for material in Material::ALL {
        assert_eq!(material.name().parse::<Material>(), Ok(material));
    }
    let holds = [Protocol::EXTEND_HOLD, Protocol::LONG_HOLDS];
    for protocol in holds.into_iter().chain([Protocol::EXTEND_RETRACT, Protocol::LOAD_STEPS, Protocol::MIXED]) {
        assert_eq!(protocol.name().parse::<Protocol>(), Ok(protocol));
    }
    assert!("latex".parse::<Material>().is_err() && "wiggle".parse::<Protocol>().is_err());
}

/// Returns settings with a rest, then eight moves to and fro: to a position in 2 s and a hold for 8 s.
fn followed(values: [f64; 2], quantity: ReferenceQuantity, person: Person) -> SimulationSettings {
    let position = |value: f64| Position { name: value.to_string(), values: vec![value], sd: 0.01 };
    let mut steps = vec![PacedStep { to: 0, move_s: 0.0, hold_s: 10.0 }];
    steps.extend((0..16).map(|k| PacedStep { to: (k + 1) % 2, move_s: 2.0, hold_s: 8.0 }));
    let pacing = Pacing { quantity, joints: vec![], positions: values.map(position).to_vec(), steps };
    let followed = Some(Followed { pacing, joint: 0, person });
    SimulationSettings { followed, ..settings(SHORT_HOLD) }
}

/// Returns the strain in the middle of each hold but the first.
fn held(trace: &Trace) -> Vec<f64> {
    (0..16).map(|k| strain(trace)[20 * (10 + 10 * k + 6)]).collect()
}

#[test]
fn a_person_follows_a_protocol_late_and_reaches_its_positions() {
    let exact = Person { mark_sd: 0.0, missed: 0.0, cut_short: 0.0 };
    let trace = simulate(&followed([0.0, 0.2], ReferenceQuantity::Strain, exact)).unwrap();
    assert_eq!(trace.time_s.last(), Some(&170.0));
    let positions: Vec<f64> = (0..16).map(|k| if k % 2 == 0 { 0.2 } else { 0.0 }).collect();
    assert_eq!(held(&trace), positions);
    // Cues are at multiples of ten seconds; nobody reacts within 0.15 s, and everybody has moved within 2 s.
    for cue in 1..17 {
        let at = |seconds: f64| strain(&trace)[(20.0 * (10.0 * f64::from(cue) + seconds)) as usize];
        assert_eq!(at(0.1), at(-0.5));
        assert!((at(2.0) - at(0.1)).abs() > 0.05, "{cue}");
    }
    // Angles stretch the sensor up to its full stretch, and are the reference.
    let angles = simulate(&followed([0.0, 90.0], ReferenceQuantity::AngleDeg, exact)).unwrap();
    assert_eq!(angles.reference.as_ref().unwrap().quantity, ReferenceQuantity::AngleDeg);
    assert_eq!(held(&angles)[0], 90.0);
}

#[test]
fn a_person_errs_as_much_as_stated() {
    let person = Person { mark_sd: 0.05, missed: 0.0, cut_short: 0.0 };
    let mut squares = Vec::new();
    for seed in 0..60 {
        let settings = SimulationSettings { seed, ..followed([0.1, 0.3], ReferenceQuantity::Strain, person) };
        let trace = simulate(&settings).unwrap();
        let errors = held(&trace).into_iter().enumerate().map(|(k, x)| x - if k % 2 == 0 { 0.3 } else { 0.1 });
        squares.extend(errors.map(|error| error * error));
    }
    // 0.05 of a span of 0.2. Half of the variance is the same at all visits of a position within a recording. The variance of 120 draws is
    // known to 13 %, so three deviations are a fifth of the standard deviation.
    let sd = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((sd / 0.01 - 1.0).abs() < 0.2, "{sd}");
    let missing = Person { mark_sd: 0.0, missed: 0.3, cut_short: 0.0 };
    let trace = simulate(&followed([0.0, 0.2], ReferenceQuantity::Strain, missing)).unwrap();
    let stayed = held(&trace).windows(2).filter(|pair| pair[0] == pair[1]).count();
    assert!((1..15).contains(&stayed), "{stayed}");
    let hasty = Person { mark_sd: 0.0, missed: 0.0, cut_short: 1.0 };
    let trace = simulate(&followed([0.0, 0.2], ReferenceQuantity::Strain, hasty)).unwrap();
    let at_end = strain(&trace)[20 * 20 - 1];
    assert!((0.05..0.15).contains(&at_end), "{at_end}");
}

#[test]
fn positions_that_no_sensor_reaches_are_refused() {
    let usual = Person::default();
    let far = simulate(&followed([0.0, 0.7], ReferenceQuantity::Strain, usual));
    assert!(matches!(far, Err(SettingsError::OutOfRange { setting: "strain of a position", .. })), "{far:?}");
    assert!("mark_sd=2".parse::<Person>().is_err() && "missed=0.1".parse::<Person>().is_ok());
}
