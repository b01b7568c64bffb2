//! `fit-law`: output for recordings with a known law, and refusals.

use crate::common::Bench;

/// Exit code for the contents of an input.
const CONTENT: i32 = 4;
/// Exit code for arguments.
const ARGUMENTS: i32 = 2;

/// Two stretches with holds and rests by the simulator.
const SIMULATE: [&str; 7] = ["simulate", "--protocol", "extend-hold", "--sample-rate-hz", "10", "-o", "trace.csv"];

fn simulated() -> Bench {
    let bench = Bench::new();
    bench.run(&SIMULATE).ok();
    bench
}

/// A stretch of 10 s at 0.02 /s and a hold of 30 s after a rest of 5 s, as equations 8 and 9 are printed: r₀ = 2000 Ω,
/// τ₀ = 6 s, v η + r₁ = 1600 Ω, r₀′ = 0.1.
fn as_printed() -> String {
    let mut out = String::from("# material = paper\n# gauge_length_mm = 30\ntime_s,resistance_ohm,strain\n");
    let end = 2000.0 * (-10.0_f64 / 6.0).exp() * 0.2 + 1600.0;
    for i in 0..=450 {
        let time_s = 0.1 * f64::from(i);
        let (t, strain) = (time_s - 5.0, (0.02 * (time_s - 5.0)).clamp(0.0, 0.2));
        let resistance = match t {
            t if t < 0.0 => 1600.0,
            t if t <= 10.0 => 2000.0 * (-t / 6.0).exp() * strain + 1600.0,
            t => end * (0.9 + 0.1 * (-(t - 10.0) / 6.0).exp()),
        };
        out += &format!("{time_s:.1},{resistance:.6},{strain:.6}\n");
    }
    out
}

fn json(bench: &Bench, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&bench.run(&[&["fit-law", "--json"], arguments].concat()).ok()).unwrap()
}

/// Returns a parameter or derived quantity of a fit.
#[track_caller]
fn value(fit: &serde_json::Value, name: &str) -> f64 {
    let all = ["parameters", "derived"].into_iter().flat_map(|group| fit[group].as_array().unwrap());
    let found = all.into_iter().find(|own| own["name"] == name);
    found.unwrap_or_else(|| panic!("no {name} in {fit}"))["value"].as_f64().unwrap()
}

#[test]
fn the_published_laws_come_back() {
    let bench = Bench::new();
    bench.write("trace.csv", as_printed());
    let fits = json(&bench, &["trace.csv"]);
    let fits = fits["fits"].as_array().unwrap();
    assert_eq!(fits.len(), 1);
    let fit = &fits[0];
    assert_eq!(
        (fit["recording"].as_str(), fit["segment"].as_str(), fit["law"].as_str(), fit["material"].as_str()),
        (Some("trace.csv"), Some("extend:1+hold:2"), Some("eq8+eq9"), Some("paper"))
    );
    // The segments' borders are found to a row or two, 0.2 s against τ₀ = 6 s. A shift of the law in time by that much changes
    // its parameters by a few percent.
    for (name, truth) in [("r0", 2000.0), ("tau0_s", 6.0), ("v*eta+r1", 1600.0), ("r0_hold", 0.1)] {
        let found = value(fit, name);
        assert!((found / truth - 1.0).abs() < 0.05, "{name}: {found}");
    }
    assert!(fit["r2"].as_f64().unwrap() > 0.99);
    assert!((fit["speed_per_s"].as_f64().unwrap() - 0.02).abs() < 1e-3);
}

#[test]
fn every_law_fits_its_segments() {
    let bench = simulated();
    let laws = [
        ("eq1", 4, 5),
        ("eq2", 4, 4),
        ("eq5:3", 4, 6),
        ("eq6", 4, 3),
        ("eq7:2", 4, 5),
        ("eq8", 4, 3),
        ("eq9", 4, 3),
        ("eq8+eq9", 4, 4),
        ("kww", 4, 4),
        ("prony:3", 4, 7),
        ("tunnelling", 4, 4),
    ];
    for (law, segments, parameters) in laws {
        let report = json(&bench, &["--law", law, "trace.csv"]);
        let fits = report["fits"].as_array().unwrap();
        assert_eq!(fits.len(), segments, "{law}");
        for fit in fits {
            assert_eq!(fit["parameters"].as_array().unwrap().len(), parameters, "{law}");
            assert!(fit["n"].as_u64().unwrap() > 50, "{law}");
            assert!(fit["r2"].as_f64().unwrap().is_finite() && fit["aic"].as_f64().unwrap().is_finite(), "{law}");
        }
    }
}

#[test]
fn a_law_that_contains_another_fits_no_worse() {
    let bench = simulated();
    let sum = |law: &str, modulus: &str| {
        let report = json(&bench, &["--law", law, "--modulus", modulus, "trace.csv"]);
        let fits = report["fits"].as_array().unwrap().clone();
        fits.iter().map(|fit| 1.0 - fit["r2"].as_f64().unwrap()).collect::<Vec<f64>>()
    };
    for law in ["eq8", "eq9", "eq8+eq9"] {
        let nested = [sum(law, "single"), sum(law, "eq6"), sum(law, "eq7:2")];
        for pair in nested.windows(2) {
            for (small, large) in pair[0].iter().zip(&pair[1]) {
                // Equal where the added parameter has no effect, apart from the optimiser's last digits.
                assert!(*large <= small * (1.0 + 1e-6), "{law}: {large} after {small}");
            }
        }
    }
}

#[test]
fn segments_are_chosen_by_phase_and_number() {
    let bench = simulated();
    let labels = |arguments: &[&str]| -> Vec<String> {
        let report = json(&bench, &[arguments, &["trace.csv"]].concat());
        let fits = report["fits"].as_array().unwrap().clone();
        fits.iter().map(|fit| fit["segment"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(labels(&["--law", "eq9"]), ["hold:2", "hold:3", "hold:4", "hold:5"]);
    assert_eq!(labels(&["--law", "eq9", "--segment", "hold:2,hold:4"]), ["hold:2", "hold:4"]);
    assert_eq!(labels(&["--law", "kww", "--segment", "hold:1"]), ["hold:1"]);
    assert_eq!(labels(&["--segment", "extend"]), ["extend:1+hold:2", "extend:2+hold:4"]);
    assert_eq!(labels(&["--segment", "hold:3"]), ["retract:1+hold:3"]);
    assert_eq!(labels(&["--law", "eq8", "--segment", "retract:2"]), ["retract:2"]);
    assert_eq!(labels(&["--segment", "extend", "--pool"]), ["extend:1+hold:2,extend:2+hold:4"]);
    assert_eq!(labels(&["--law", "prony:2", "--segment", "whole"]), ["whole"]);
}

#[test]
fn laws_of_time_need_no_reference() {
    let bench = Bench::new();
    let rows = (0..50).map(|i| format!("{i},{}\n", 1000.0 + 50.0 * (-f64::from(i) / 7.0).exp()));
    bench.write("trace.csv", format!("time_s,resistance_ohm\n{}", rows.collect::<String>()));
    let report = json(&bench, &["--law", "eq9", "--segment", "whole", "trace.csv"]);
    // The readings are exact, apart from rounding.
    assert!((value(&report["fits"][0], "tau0_s") - 7.0).abs() < 1e-6);
    assert!((value(&report["fits"][0], "r_start") - 1050.0).abs() < 1e-6);
    bench.run(&["fit-law", "--law", "eq9", "trace.csv"]).fails(
        CONTENT,
        "trace.csv:1: column `strain`: expected a reference (strain, displacement_mm or angle_deg), found none",
    );
}

#[test]
fn the_table_has_one_row_per_material_speed_and_phase() {
    let bench = Bench::new();
    let simulate = |material: &str, speed: &str, file: &str| {
        let arguments = ["simulate", "--protocol", "extend-hold", "--sample-rate-hz", "10", "--material", material];
        bench.run(&[&arguments[..], &["--speed-mm-s", speed, "-o", file]].concat()).ok();
    };
    simulate("ecoflex-00-50", "1", "slow.csv");
    simulate("ecoflex-00-50", "5", "fast.csv");
    simulate("vytaflex-10", "1", "other.csv");
    let printed = bench.run(&["fit-law", "--table", "slow.csv", "fast.csv", "other.csv"]).ok();
    let rows: Vec<Vec<&str>> =
        printed.lines().map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect();
    assert_eq!(rows[0][..4], ["material", "speed, mm/s", "phase", "segments"]);
    // Columns that do not fit a terminal continue below.
    let last = rows.iter().rposition(|row| row[0] == "material").unwrap();
    assert!(last > 0 && rows[last].last() == Some(&"R^2"), "{printed}");
    let found: Vec<(&str, i32, &str, &str)> =
        rows[2..14].iter().map(|row| (row[0], row[1].parse::<f64>().unwrap().round() as i32, row[2], row[3])).collect();
    let phases = ["extend", "hold", "retract", "rest"];
    let expected: Vec<(&str, i32, &str, &str)> = [("ecoflex-00-50", 1), ("ecoflex-00-50", 5), ("vytaflex-10", 1)]
        .into_iter()
        .flat_map(|(material, speed)| phases.map(|phase| (material, speed, phase, "2")))
        .collect();
    assert_eq!(found, expected, "{printed}");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let bench = simulated();
    let refuses = |arguments: &[&str], code: i32, message: &str| {
        bench.run(&[&["fit-law"], arguments, &["trace.csv"]].concat()).fails(code, message);
    };
    refuses(&["--law", "kww", "--modulus", "eq6"], ARGUMENTS, "--modulus is for eq8, eq9 and eq8+eq9, not for kww");
    refuses(&["--law", "eq9", "--segment", "extend"], ARGUMENTS, "eq9 is not about segments of the kind extend");
    refuses(
        &["--law", "eq9", "--segment", "hold:2,hold:9"],
        CONTENT,
        "trace.csv: expected segments hold:9 for eq9, found 2 extend, 5 hold, 2 retract",
    );
    bench.write("short.csv", "time_s,resistance_ohm\n0,1\n1,2\n2,3\n");
    bench
        .run(&["fit-law", "--law", "eq9", "--segment", "whole", "short.csv"])
        .fails(CONTENT, "short.csv: whole: 3 readings, at least 5 are needed");
    let wrong = bench.run(&["fit-law", "--law", "eq3", "trace.csv"]);
    assert_eq!((wrong.code, wrong.stdout.as_str()), (Some(ARGUMENTS), ""));
    assert!(wrong.stderr.contains("expected eq1, eq2"), "{}", wrong.stderr);
}

#[test]
fn laws_are_compared_on_the_same_readings() {
    let bench = Bench::new();
    bench.write("trace.csv", as_printed());
    // The hold is one exponential: laws with more parameters fit as well, and cost more.
    let csv = bench.run(&["fit-law", "trace.csv", "--compare", "prony:2,prony:1,kww", "--format", "csv"]).ok();
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 3, "{csv}");
    assert!(rows.iter().all(|row| row[4].parse::<f64>().unwrap() > 0.999), "{csv}");
    assert!(rows.iter().any(|row| row[6] == "0"), "{csv}");
    // With all digits; a terminal shows fewer.
    assert!(rows.iter().all(|row| row[5].parse::<f64>().is_ok()) && rows[1][6].len() > 6, "{csv}");
    assert!(csv.starts_with("recording,segment,law,parameters,R^2,\"residual sd, ohm\","), "{csv}");
    let json = bench.run(&["fit-law", "trace.csv", "--compare", "prony:2,prony:1,kww", "--json"]).ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let ranked = json["ranked"].as_array().unwrap();
    assert!(json["schema"] == 1 && ranked.len() == rows.len() && ranked[0]["unit"] == "ohm", "{json}");
    for (one, row) in ranked.iter().zip(&rows) {
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let above = number(&one["aicc"]) - number(&ranked[0]["aicc"]);
        assert!(one["law"] == row[2] && (number(&one["delta_aicc"]) - above).abs() < 1e-6, "{json}");
        assert!((row[6].parse::<f64>().unwrap() - above).abs() < 1e-6, "{json}");
    }
    for laws in ["eq8,kww,eq8+eq9", "eq1,eq8"] {
        let refused = bench.run(&["fit-law", "trace.csv", "--compare", laws]);
        assert!(refused.code == Some(2) && refused.stderr.contains("choose laws of one phase"), "{}", refused.stderr);
    }
}

#[test]
fn fits_come_as_csv_latex_and_figures() {
    let bench = Bench::new();
    bench.write("trace.csv", as_printed());
    let csv = bench.run(&["fit-law", "trace.csv", "--format", "csv", "--figures", "figures"]).ok();
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column =
        csv.lines().next().unwrap().replace(", ", " ").split(',').position(|name| name.starts_with("tau0")).unwrap();
    let tau0: f64 = lines[1][column].parse().unwrap();
    // The ends of the movement are found to a row: 0.1 s of 10 s.
    assert!((tau0 / 6.0 - 1.0).abs() < 0.01, "{csv}");
    let latex = bench.run(&["fit-law", "trace.csv", "--table", "--format", "latex"]).ok();
    assert!(
        latex.contains("\\begin{tabular}") && latex.contains("$\\pm$") && latex.ends_with("\\end{tabular}\n"),
        "{latex}"
    );
    let files = crate::common::files_in(&bench.path("figures"));
    assert_eq!(files, ["01-eq8-eq9-extend-1-hold-2.csv", "01-eq8-eq9-extend-1-hold-2.svg"]);
    // The drawn law meets the reading at the end of the movement: 2000 exp(-10/6) 0.2 + 1600.
    let drawn = bench.read("figures/01-eq8-eq9-extend-1-hold-2.csv");
    let end = 2000.0 * (-10.0_f64 / 6.0).exp() * 0.2 + 1600.0;
    let law = drawn.lines().filter(|line| line.starts_with("\"eq8+eq9"));
    let points = law.map(|line| {
        let mut numbers = line.rsplit(',').map(|cell| cell.parse::<f64>().unwrap());
        (numbers.next().unwrap(), numbers.next().unwrap())
    });
    let at_end = points.min_by(|a, b| (a.1 - 10.0).abs().total_cmp(&(b.1 - 10.0).abs()));
    let found = at_end.unwrap_or_else(|| panic!("{drawn}")).0;
    // A row is 0.1 s, in which the reading changes by some 1.5 ohms; the fit is good to the error of its times.
    assert!((found - end).abs() < 1.5, "{found} {end}");
}

/// A movement explains nearly all of the variance, and hides that the hold deviates.
#[test]
fn a_phase_that_its_law_does_not_describe_is_warned_of() {
    let bench = Bench::new();
    // In the hold the law has one exponential, and the readings wave by 3 ohms where the movement spans 130.
    let waves = |line: &str| {
        let cells: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        match cells[..] {
            [t, _, strain] if t > 15.0 => format!("{t},{},{strain}\n", 1675.5 + 3.0 * (2.0 * t).sin()),
            _ => format!("{line}\n"),
        }
    };
    bench.write("trace.csv", as_printed().lines().map(waves).collect::<String>());
    let run = bench.run(&["fit-law", "trace.csv", "--table"]);
    let warned: Vec<&String> =
        run.warnings.iter().filter(|line| line.contains("R^2 of the hold by itself is ")).collect();
    assert_eq!(warned.len(), 1, "{:?} {}", run.warnings, run.stdout);
    let plain = bench.run(&["fit-law", "trace.csv"]);
    assert!(plain.warnings.iter().all(|line| !line.contains("by itself")), "{:?}", plain.warnings);
}
