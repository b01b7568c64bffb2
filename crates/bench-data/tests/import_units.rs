//! Ohms with a prefix in each cell, and references in volts or counts.

use std::fmt::Write as _;

use proptest::prelude::*;
use proptest::sample::select;

use crate::import_files::{asks, decimal, file, is_imported, proposed, tables, truth};
use ohmstrain_bench_data::import::{Plan, Recipe};

const ROW: &str = "Time (s),R,Strain (%)\n";

/// Returns a file of resistances, with tenths of an ohm written by `ohm`.
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
    // An instrument with automatic ranges.
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
    // Names of columns, and lengths, are not ohms.
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
    let expected = "--column 'displacement=Position (V)' --unit displacement=4mm/V with its scale";
    assert!(imported.remarks.iter().any(|remark| remark.contains(expected)), "{:?}", imported.remarks);
    let column = vec![("displacement".parse().unwrap(), "Position (V)".parse().unwrap())];
    let known = Recipe { columns: column.clone(), gauge_length_mm: Some(100.0), ..nothing };
    asks(&[("a.csv", &volts)], &known, &["the unit `V` is none of displacement", "--unit displacement=4mm/V"]);
    // At 1 mm per V on 100 mm the volts are percent, as in `truth`.
    let scaled = Recipe { units: vec![("displacement".parse().unwrap(), "1mm/V".to_owned())], ..known };
    let (recipe, imported) = proposed(&[("a.csv", volts.into())], &scaled).unwrap();
    assert!(recipe.arguments().contains(&"displacement=1mm/V".to_owned()), "{:?}", recipe.arguments());
    for (found, expected) in imported.trace.reference.unwrap().values.iter().zip(truth().strain()) {
        assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected, "{found} {expected}");
    }
}

/// Generates rows: milliohms, and tenths of a millivolt.
fn rows() -> impl Strategy<Value = Vec<(i64, i64)>> {
    proptest::collection::vec((200_000_i64..3_000_000_000, -50_000_i64..50_000), 12..40)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    /// Every suggestion for such files is accepted, and gives their numbers.
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

#[test]
fn a_conductance_is_one_over_a_resistance() {
    let siemens = |tenths: i64, per_siemens: f64| per_siemens / (tenths as f64 / 10.0);
    for (name, per_siemens) in
        [("Conductance (uS)", 1e6), ("Leitwert [mS]", 1e3), ("conductance_us", 1e6), ("G (S)", 1.0)]
    {
        let names = format!("Time (s),{name},Strain (%)\n");
        let text = with_ohms(&names, |tenths| siemens(tenths, per_siemens).to_string());
        let (_, imported) =
            proposed(&[("g.csv", text.into())], &Recipe::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        // The quotient, the file's digits and the inverse have one rounding each.
        let is_near = |(found, expected): (&f64, f64)| (found / expected - 1.0).abs() < 3.0 * f64::EPSILON;
        assert!(imported.trace.readings.values.iter().zip(truth().ohm()).all(is_near), "{name}");
    }
    let bare = with_ohms("Time (s),Conductance,Strain (%)\n", |tenths| siemens(tenths, 1e6).to_string());
    asks(&[("g.csv", &bare)], &Recipe::default(), &["R = 1/G", "--unit resistance=uS"]);
    let open =
        with_ohms(
            "Time (s),Conductance (mS),Strain (%)\n",
            |tenths| if tenths > 16_500 { "0".into() } else { "1".into() },
        );
    asks(&[("g.csv", &open)], &Recipe::default(), &["--drop-zeros resistance"]);
}

#[test]
fn stretch_ratios_and_relative_changes() {
    let row = |ms, ohm, strain| {
        format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(10_000 + strain, 4, '.'))
    };
    let text = file("Time (s),R (Ohm),Stretch ratio\n", row);
    let recipe = proposed(&[("lambda.csv", text.clone().into())], &Recipe::default()).unwrap();
    assert!(recipe.0.arguments().windows(2).any(|flag| flag == ["--zero", "strain=1"]), "{:?}", recipe.0.arguments());
    let strain = recipe.1.trace.reference.unwrap().values;
    // Digits below the precision of 1 are lost.
    assert!(strain.iter().zip(truth().strain()).all(|(found, expected)| (found - expected).abs() <= f64::EPSILON));
    let asked = Plan::new(&tables(&[("lambda.csv", text.into())], &Recipe::default()).unwrap(), &Recipe::default());
    assert!(asked.unwrap_err().to_string().contains("--zero strain=1"));
    let row = |ms, ohm, strain| format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.'));
    for name in ["ΔR/R₀ (%)", "∆R/R0 [%]", "(R-R0)/R0 (%)"] {
        let (_, imported) =
            proposed(&[("change.csv", file(&format!("Time (s),{name},Strain (%)\n"), row).into())], &Recipe::default())
                .unwrap();
        assert_eq!(imported.trace.readings.values[0], 1.016, "{name}");
    }
    let large = file("Time (s),R/R0 (%),Strain (%)\n", |ms, ohm, strain| row(ms, 1_000_000 + ohm, strain));
    asks(&[("ratio.csv", &large)], &Recipe::default(), &["--unit ratio=percent or --unit ratio=change-percent"]);
}

#[test]
fn units_stand_in_a_column_of_their_own() {
    let row = |ms, ohm, strain| {
        format!("{},{},kOhm,{},%", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.'))
    };
    is_imported("meter.csv", file("Time (s),Reading,Unit,Strain,Unit\n", row), &Recipe::default());
}
