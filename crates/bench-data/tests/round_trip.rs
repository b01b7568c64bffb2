//! Written traces are read back, bit by bit.

use ohmstrain_bench_data::{
    ConverterReadings, FrontEndSpec, JointSpec, Metadata, ReadingKind, Readings, Reference, ReferenceQuantity, Trace,
};
use ohmstrain_model::{AdcCode, SensorSide};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

/// Returns a value, occasionally a missing one.
fn maybe_missing(value: impl Strategy<Value = f64>) -> impl Strategy<Value = f64> {
    option::weighted(0.8, value).prop_map(|value| value.unwrap_or(f64::NAN))
}

fn front_end() -> impl Strategy<Value = FrontEndSpec> {
    let side = prop_oneof![Just(SensorSide::Low), Just(SensorSide::High)];
    let divider = (1.0..1e6_f64, side, 8..24_u32, 0.0..3.0_f64).prop_map(|(reference_ohm, side, bits, noise_codes)| {
        FrontEndSpec::Divider { reference_ohm, side, bits, noise_codes }
    });
    let source = (1e-6..1e-2_f64, 1.0..100.0_f64, 1.0..5.0_f64, 8..24_u32, 0.0..3.0_f64).prop_map(
        |(current_a, gain, full_scale_v, bits, noise_codes)| FrontEndSpec::ConstantCurrent {
            current_a,
            gain,
            full_scale_v,
            bits,
            noise_codes,
        },
    );
    prop_oneof![divider, source]
}

fn joint() -> impl Strategy<Value = JointSpec> {
    (-0.1..0.2_f64, 1.0..50.0_f64, 10.0..100.0_f64).prop_map(|(prestrain, moment_arm_mm, gauge_length_mm)| JointSpec {
        prestrain,
        moment_arm_mm,
        gauge_length_mm,
    })
}

fn metadata() -> impl Strategy<Value = Metadata> {
    let word = "[a-zé0-9]([ -~é]{0,20}[!-~é])?";
    (
        option::of(word),
        option::of(1.0..500.0_f64),
        option::of(front_end()),
        option::of(joint()),
        vec(("x[a-z_]{0,9}", word), 0..3),
    )
        .prop_map(|(material, gauge_length_mm, front_end, joint, other)| Metadata {
            material,
            gauge_length_mm,
            front_end,
            joint,
            other,
            ..Metadata::default()
        })
}

fn converted(front_end: &FrontEndSpec, codes: Vec<Option<u32>>) -> Readings {
    let front_end = front_end.build().unwrap();
    let mut converter = ConverterReadings::default();
    let mut values = Vec::new();
    for code in codes {
        let (value, sd, saturated) = match code.map(|code| front_end.read(code)) {
            None => (f64::NAN, f64::NAN, false),
            Some(AdcCode::Saturated) => (f64::NAN, f64::NAN, true),
            Some(AdcCode::Reading(ohms)) => (ohms.resistance_ohm, ohms.sd_ohm, false),
        };
        values.push(value);
        converter.codes.push(code);
        converter.sd_ohm.push(sd);
        converter.saturated.push(saturated);
    }
    Readings { kind: ReadingKind::Ohm, values, converter: Some(converter) }
}

/// Readings, reference, temperature, the reference's deviation, code and step of one row.
type Cells = (f64, f64, f64, f64, Option<u32>, f64);

fn trace() -> impl Strategy<Value = Trace> {
    let row = (
        maybe_missing(1e-3..1e9_f64),
        maybe_missing(-1.0..2.0_f64),
        maybe_missing(-40.0..90.0_f64),
        1e-6..1.0_f64,
        option::weighted(0.9, 0..300_u32),
        1e-6..10.0_f64,
    );
    let shape = (0..3_usize, 0..3_usize, any::<bool>(), any::<bool>(), -1e3..1e6_f64);
    (metadata(), vec(row, 1..40), shape).prop_map(|(mut metadata, rows, (kind, quantity, warm, exact, start))| {
        let column = |pick: fn(&Cells) -> f64| rows.iter().map(pick).collect::<Vec<f64>>();
        let plain = |kind| Readings { kind, values: column(|row| row.0), converter: None };
        let readings = match (kind, &metadata.front_end) {
            (0, Some(front_end)) => converted(front_end, rows.iter().map(|row| row.4).collect()),
            (1, _) => plain(ReadingKind::Ratio),
            _ => plain(ReadingKind::Ohm),
        };
        if quantity == 1 {
            // With a joint an angle would be read as strain.
            metadata.joint = None;
        }
        let reference =
            [Some(ReferenceQuantity::Strain), Some(ReferenceQuantity::AngleDeg), None][quantity].map(|quantity| {
                let sd = rows.iter().map(|row| if row.1.is_nan() { f64::NAN } else { row.3 });
                let none_known = rows.iter().all(|row| row.1.is_nan());
                let sd = if exact || none_known { Vec::new() } else { sd.collect() };
                Reference { quantity, values: column(|row| row.1), sd }
            });
        let time_s = rows
            .iter()
            .scan(start, |time, row| {
                *time += row.5;
                Some(*time)
            })
            .collect();
        Trace { metadata, time_s, readings, reference, temperature_c: warm.then(|| column(|row| row.2)) }
    })
}

/// True if traces are equal bit by bit, where a missing value equals a missing value.
fn same(a: &Trace, b: &Trace) -> bool {
    // `Debug` prints the shortest digits that identify a number, and `NaN` for every NaN.
    format!("{a:?}") == format!("{b:?}")
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn writing_and_reading_gives_the_same_trace(trace in trace()) {
        let mut file = Vec::new();
        trace.write(&mut file).unwrap();
        let back = Trace::read(file.as_slice(), "t.csv");
        prop_assert!(back.is_ok(), "{:?}\n{}", back, String::from_utf8_lossy(&file));
        let back = back.unwrap();
        prop_assert!(same(&trace, &back), "{trace:?}\n{back:?}");
        let mut rewritten = Vec::new();
        back.write(&mut rewritten).unwrap();
        prop_assert_eq!(file, rewritten);
    }

    #[test]
    fn no_bytes_make_the_reader_panic(head in 0..3_usize, bytes in vec(any::<u8>(), 0..200)) {
        let head = ["", "time_s,resistance_ohm\n", "# front_end = "][head];
        let _ = Trace::read([head.as_bytes(), &bytes].concat().as_slice(), "t.csv");
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "[-#=,.\"0-9einfaNtms_ \r\n]{0,80}") {
        let _ = Trace::read(text.as_bytes(), "t.csv");
        let _ = Trace::read(format!("time_s,resistance_ohm\n{text}").as_bytes(), "t.csv");
    }
}

#[test]
fn a_value_with_a_line_break_stays_one_comment() {
    let mut trace = Trace::read(&b"time_s,resistance_ohm\n0,1\n"[..], "t").unwrap();
    trace.metadata.material = Some("a\n0,2".to_owned());
    let mut file = Vec::new();
    trace.write(&mut file).unwrap();
    assert_eq!(String::from_utf8(file).unwrap(), "# material = a 0,2\ntime_s,resistance_ohm\n0,1\n");
}
