//! Reports and figures of `evaluate` and `calibrate`.

use crate::common::{Bench, CALIBRATED_UNTIL, SIMULATE, assert_one_whole_page, files_in};

#[test]
fn evaluate_draws_the_part_that_is_scored() {
    let bench = Bench::calibrated();
    let flags = ["evaluate", "trace.csv", "--sensor", "sensor.toml", "--report", "report.html", "--figures", "figures"];
    let from = ["--from", CALIBRATED_UNTIL];
    for _ in 0..2 {
        bench.run(&[&flags[..], &from[..]].concat()).ok();
    }
    let report = bench.read("report.html");
    // Three quarters of the rows, the earlier ones, were calibrated on.
    assert!(report.contains("not calibrated on, scored from 300 s on") && report.contains("estimator “ekf”"));
    assert!(report.contains("scored part") && !report.contains("in-sample"));
    bench.run(&flags).ok();
    assert!(bench.read("report.html").contains("partly in-sample"));
    for name in ["strain-against-time.svg", "strain-against-time.csv"] {
        let first = bench.read(&format!("figures/{name}")).lines().next().unwrap().to_owned();
        assert!(first.contains(", partly in-sample"), "{first}");
    }
    let sensor = bench.run(&flags[..4]).ok();
    assert!(sensor.starts_with("trace.csv: errors in strain, partly in-sample\n"), "{sensor}");
    let kept = bench.run(&[&flags[..4], &from].concat()).ok();
    assert!(kept.starts_with("trace.csv: errors in strain\n"), "{kept}");

    let files = files_in(&bench.path("figures"));
    let names = |ending: &str| -> Vec<String> {
        files.iter().filter_map(|file| file.strip_suffix(ending)).map(str::to_owned).collect()
    };
    assert_eq!(names(".svg"), names(".csv"));
    for wanted in [
        "strain-against-time",
        "error-against-time",
        "hysteresis-loop",
        "loops-by-speed",
        "gauge-curve",
        "relaxation-while-held",
        "rate-of-relaxation",
    ] {
        assert!(names(".svg").iter().any(|name| name == wanted), "{wanted}: {files:?}");
    }
    // A common scale, so that letters have the same size: millimetres of paper per unit of the drawing.
    let scale = |name: &String| -> f64 {
        let svg = bench.read(&format!("figures/{name}.svg"));
        let between = |start: &str, end: &str| svg.split(start).nth(1).unwrap().split(end).next().unwrap().to_owned();
        let (width, view) = (between(" width=\"", "mm\""), between("viewBox=\"", "\""));
        assert!(["170", "85"].contains(&width.as_str()), "{name}: {width} mm");
        width.parse::<f64>().unwrap() / view.split(' ').nth(2).unwrap().parse::<f64>().unwrap()
    };
    let scales: Vec<f64> = names(".svg").iter().map(scale).collect();
    assert!(scales.iter().all(|scale| (scale / scales[0] - 1.0).abs() < 1e-9), "{scales:?}");
    // A series drawn as dots has a dot in the legend.
    assert!(bench.read("figures/gauge-curve.svg").split("<g transform").next().unwrap().contains("<circle "));
    // The reference in the CSV is the recording's: strain in percent, between 0 and 10 mm on 30 mm.
    let csv = bench.read("figures/strain-against-time.csv");
    let reference: Vec<f64> = csv
        .lines()
        .filter(|line| line.starts_with("\"reference\""))
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    let largest = reference.iter().copied().fold(0.0, f64::max);
    assert!(reference.len() > 500 && (largest - 100.0 / 3.0).abs() < 0.1, "{largest}");
}

#[test]
fn a_calibration_reports_in_sample_and_says_so() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let flags = ["calibrate", "trace.csv", "--until", "60", "--estimator", "ekf", "-o", "sensor.toml"];
    bench.run(&[&flags[..], &["--report", "report.html", "--figures", "figures"]].concat()).ok();
    assert_eq!(bench.files(), ["figures", "report.html", "sensor.toml", "trace.csv"]);
    let report = bench.read("report.html");
    assert_one_whole_page(&report);
    for words in ["in-sample", "<dt>Left out</dt>", "<dt>Record next</dt>", "static curve; its error bars"] {
        assert!(report.contains(words), "{words}");
    }
    bench.write("figures/strain-against-time.svg", "<svg>mine</svg>");
    let refused = bench.run(&[&flags[..], &["--figures", "figures"]].concat());
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("something else than a figure"), "{}", refused.stderr);
}
