//! Ohms with a prefix in each cell, and references in volts or counts.

use std::fmt::Write as _;

use proptest::prelude::*;
use proptest::sample::select;

use crate::import_files::{asks, decimal, file, is_imported, proposed, tables, truth};
use ohmstrain_bench_data::import::{Plan, Recipe};

const ROW: &str = "Time (s),R,Strain (%)\n";

/// Resistances as `ohm` writes tenths of an ohm.
fn with_ohms(above: &str, ohm: impl Fn(i64) -> String) -> String {
    file(above, |ms, tenths, strain| format!("{},{},{}", decimal(ms, 3, '.'), ohm(tenths), decimal(strain, 2, '.')))
}

#[test]
fn ohms_with_a_prefix_are_ohms() {
    let nothing = Recipe::default();
    let kilo = |tenths: i64, suffix: &str| decimal(tenths, 4, '.') + suffix;
    for (above, suffix) in [(ROW, "k"), (ROW, "K"), ("Time (s),R (Ohm),Strain (%)\n", "k"), (ROW, " kΩ"), (ROW, "kOhm")]
    {
        is_imported("prefix.csv", with_ohms(above, |tenths| kilo(tenths, suffix)), &nothing);
    }
    is_imported("mega.csv", with_ohms(ROW, |tenths| decimal(tenths, 7, '.') + "M"), &nothing);
    // An instrument that chooses its range itself.
    let ranged = |tenths: i64| if tenths > 16_200 { kilo(tenths, " kOhm") } else { decimal(tenths, 1, '.') + " Ohm" };
    is_imported("ranges.csv", with_ohms(ROW, ranged), &nothing);
    let bare = with_ohms(ROW, |tenths| if tenths > 16_200 { kilo(tenths, "k") } else { decimal(tenths, 1, '.') });
    let plan = Plan::propose(&tables(&[("bare.csv", bare.clone().into())], &nothing).unwrap(), &nothing).unwrap();
    assert!(plan.remarks.iter().any(|remark| remark.contains("cells such as `1.6")), "{:?}", plan.remarks);
    is_imported("bare.csv", bare, &nothing);
    let comma = |ms, tenths, strain| {
        format!("{};{}k;{}", decimal(ms, 3, ','), decimal(tenths, 4, ','), decimal(strain, 2, ','))
    };
    is_imported("komma.csv", file("Zeit (s);Widerstand;Dehnung (%)\n", comma), &nothing);
    // Names of columns, and lengths, are no ohms.
    is_imported("names.csv", with_ohms(ROW, |tenths| decimal(tenths, 1, '.')).replace(",R,", ",10k,"), &{
        Recipe { columns: vec![("resistance".parse().unwrap(), "10k".parse().unwrap())], ..Recipe::default() }
    });
    let lengths = file("Time (s),R (Ohm),Position\n", |ms, ohm, strain| {
        format!("{},{},{} m", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    });
    let known = Recipe {
        columns: vec![("displacement".parse().unwrap(), "Position".parse().unwrap())],
        units: vec![("displacement".parse().unwrap(), "mm".to_owned())],
        gauge_length_mm: Some(100.0),
        ..Recipe::default()
    };
    asks(&[("m.csv", &lengths)], &known, &["expected a number, found `15.03 m`"]);
    let twice = with_ohms("Time (s),R (kOhm),Strain (%)\n", |tenths| kilo(tenths, "k"));
    asks(&[("twice.csv", &twice)], &nothing, &["has a unit of its own", "--unit resistance=ohm"]);
}

#[test]
fn a_reference_in_volts_is_asked_for_its_scale() {
    let nothing = Recipe::default();
    let volts = file("Time (s),R (Ohm),Position (V)\n", |ms, ohm, strain| {
        format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    });
    let (_, imported) = proposed(&[("a.csv", volts.clone().into())], &nothing).unwrap();
    let said = "--column 'displacement=Position (V)' --unit displacement=4mm/V with its scale";
    assert!(imported.remarks.iter().any(|remark| remark.contains(said)), "{:?}", imported.remarks);
    let column = vec![("displacement".parse().unwrap(), "Position (V)".parse().unwrap())];
    let known = Recipe { columns: column.clone(), gauge_length_mm: Some(100.0), ..nothing };
    asks(&[("a.csv", &volts)], &known, &["the unit `V` is none of displacement", "--unit displacement=4mm/V"]);
    // 1 mm per V on 100 mm: the volts are percent, as `truth` has them.
    let scaled = Recipe { units: vec![("displacement".parse().unwrap(), "1mm/V".to_owned())], ..known };
    let (recipe, imported) = proposed(&[("a.csv", volts.into())], &scaled).unwrap();
    assert!(recipe.arguments().contains(&"displacement=1mm/V".to_owned()), "{:?}", recipe.arguments());
    for (found, expected) in imported.trace.reference.unwrap().values.iter().zip(truth().strain()) {
        assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected, "{found} {expected}");
    }
}

/// A row: milliohms, and tenths of a millivolt.
fn rows() -> impl Strategy<Value = Vec<(i64, i64)>> {
    proptest::collection::vec((200_000_i64..3_000_000_000, -50_000_i64..50_000), 12..40)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    /// Whatever is suggested of such files is accepted, and has their numbers.
    #[test]
    fn what_is_suggested_of_prefixes_and_volts_is_accepted_and_right(
        rows in rows(),
        suffixes in select(vec![["", "k", "M"], [" Ω", " kΩ", " MΩ"], ["Ohm", "kOhm", "MOhm"], ["R", "K", "M"]]),
        heading in select(vec!["R", "R (Ohm)", "Resistance"]),
        (per_volt, scale) in select(vec![(4.0, "4mm/V"), (-2.5, "-0.25 cm/V"), (0.001, "1um/count")]),
        unit in select(vec!["V", "counts", "steps"]),
        zero in -40_000_i64..40_000,
        comma in any::<bool>(),
    ) {
        let (separator, mark) = if comma { (';', ',') } else { ('\t', '.') };
        let mut text = format!("t (s){separator}{heading}{separator}Position ({unit})\n");
        for (row, (milliohm, tenths)) in rows.iter().enumerate() {
            let range = usize::from(*milliohm >= 1_000_000) + usize::from(*milliohm >= 1_000_000_000);
            let ohm = decimal(*milliohm, 3 + 3 * range, mark) + suffixes[range];
            let sign = if *tenths < 0 { "-" } else { "" };
            let volts = sign.to_owned() + &decimal(tenths.abs(), 4, mark);
            writeln!(text, "{}{separator}{ohm}{separator}{volts}", decimal(row as i64, 1, mark)).unwrap();
        }
        let of = |value: &str| ("displacement".parse().unwrap(), value.to_owned());
        let zero = zero as f64 / 1e4;
        let known = Recipe {
            columns: vec![("displacement".parse().unwrap(), "3".parse().unwrap())],
            units: vec![of(scale)],
            zero: vec![("displacement".parse().unwrap(), zero)],
            gauge_length_mm: Some(30.0),
            ..Recipe::default()
        };
        let (_, imported) = proposed(&[("rig.txt", text.clone().into_bytes())], &known)
            .map_err(|error| TestCaseError::fail(format!("{error}\n{text}")))?;
        let ohms: Vec<f64> = rows.iter().map(|(milliohm, _)| *milliohm as f64 / 1e3).collect();
        prop_assert_eq!(&imported.trace.readings.values, &ohms);
        for (found, (_, tenths)) in imported.trace.reference.unwrap().values.iter().zip(&rows) {
            let volts = *tenths as f64 / 1e4;
            let expected = per_volt * (volts - zero) / 30.0;
            // Two products, a difference and a quotient, and the scale's own rounding.
            let bound = 4.0 * f64::EPSILON * per_volt.abs() * (volts.abs() + zero.abs()) / 30.0;
            prop_assert!((found - expected).abs() <= bound, "{} {}", found, expected);
        }
    }
}
