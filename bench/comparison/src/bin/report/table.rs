//! Tables of the measurements, with their targets.

use std::fmt::Write;

use crate::figures::Build;

/// Target of a ratio.
enum Target {
    AtMost(f64),
    AtLeast(f64),
}

use Target::{AtLeast, AtMost};

/// A ratio of two times, and its target.
struct Ratio {
    words: &'static str,
    over: &'static str,
    under: &'static str,
    target: Target,
}

const fn ratio(words: &'static str, over: &'static str, under: &'static str, target: Target) -> Ratio {
    Ratio { words, over, under, target }
}

const TARGETS: [Ratio; 8] = [
    ratio("EKF ÷ kfilter, same step", "step/sparse_ekf_3", "step/nonlinear_kfilter_3", AtMost(0.6)),
    ratio("EKF ÷ adskalman, same step", "step/sparse_ekf_3", "step/nonlinear_adskalman_3", AtMost(0.6)),
    ratio("EKF ÷ typed-kalman, same step", "step/sparse_ekf_3", "step/nonlinear_typed_kalman_3", AtMost(0.6)),
    ratio("EKF ÷ hand-written, same step", "step/sparse_ekf_3", "step/nonlinear_reference_3", AtMost(1.15)),
    ratio("EKF of six states ÷ of three", "step/sparse_ekf_6", "step/sparse_ekf_3", AtMost(1.8)),
    ratio("UKF ÷ kfilter's with constants", "step/sparse_ukf_3", "step/kfilter_ukf_3", AtMost(0.6)),
    ratio("IMM ÷ EKF, six states", "step/imm_6", "step/sparse_ekf_6", AtMost(4.0)),
    ratio("sign-split of 8 ÷ EKF, six states", "step/sign_split_6", "step/sparse_ekf_6", AtMost(14.0)),
];

const BESIDE: [Ratio; 5] = [
    ratio("hand-written reference ÷ adskalman", "step/reference_3", "step/adskalman_3", AtMost(0.45)),
    ratio("EKF ÷ adskalman", "step/sparse_ekf_3", "step/adskalman_3", AtMost(0.6)),
    ratio("EKF ÷ typed-kalman", "step/sparse_ekf_3", "step/typed_kalman_3", AtMost(0.6)),
    ratio("EKF ÷ kfilter", "step/sparse_ekf_3", "step/kfilter_3", AtMost(0.6)),
    ratio("generic EKF ÷ sparse EKF", "step/ekf_3", "step/sparse_ekf_3", AtLeast(1.0)),
];

/// Returns the table of the ratios with targets.
pub fn targets(builds: &[Build]) -> String {
    ratios(&TARGETS, builds)
}

/// Returns the line of `instructions.toml` on the sign-split filter.
pub fn instructions(budget: &str) -> Option<String> {
    let figure = budget.lines().find_map(|line| line.strip_prefix("sign_split_6 = "))?;
    let met = figure.parse::<f64>().ok()? <= 12_000.0;
    let met = if met { '✓' } else { '✗' };
    Some(format!(
        "| sign-split of 8, six states: instructions a row | ≤ 12000 | {figure} {met} (`instructions.toml`) |\n"
    ))
}

/// Returns the ratios of the same filters to others with constant matrices.
pub fn beside_constants(builds: &[Build]) -> String {
    ratios(&BESIDE, builds)
}

/// Formats ratios; they come first, since they depend less on the machine than nanoseconds.
fn ratios(ratios: &[Ratio], builds: &[Build]) -> String {
    let mut out = header("ratio | target", builds);
    for Ratio { words, over, under, target } in ratios {
        let (sign, bound) = match target {
            AtMost(bound) => ('≤', bound),
            AtLeast(bound) => ('≥', bound),
        };
        let cells = builds.iter().map(|build| {
            let Some((over, under)) = build.ns(over).zip(build.ns(under)) else { return "not measured".into() };
            let value = over / under;
            let met = match target {
                AtMost(bound) => value <= *bound,
                AtLeast(bound) => value >= *bound,
            };
            format!("{value:.2} {}", if met { "✓" } else { "✗" })
        });
        row(&mut out, &format!("{words} | {sign} {bound}"), cells);
    }
    out
}

const STEPS: [(&str, &str); 23] = [
    ("hand-written reference, linear, without checks", "reference_3"),
    ("hand-written reference, without checks", "nonlinear_reference_3"),
    ("**EKF, sparse**", "sparse_ekf_3"),
    ("EKF, sparse, four states", "sparse_ekf_4"),
    ("EKF, sparse, six states", "sparse_ekf_6"),
    ("EKF, generic", "ekf_3"),
    ("EKF, generic, four states", "ekf_4"),
    ("EKF, generic, six states", "ekf_6"),
    ("UKF, sparse", "sparse_ukf_3"),
    ("IMM, six states", "imm_6"),
    ("sign-split of 8, six states", "sign_split_6"),
    ("best 8 hypotheses, six states", "hypotheses_6"),
    ("nalgebra written straight, without checks", "nonlinear_nalgebra_3"),
    ("adskalman 0.18", "nonlinear_adskalman_3"),
    ("typed-kalman 0.1", "nonlinear_typed_kalman_3"),
    ("kfilter 0.5", "nonlinear_kfilter_3"),
    ("nalgebra written straight, linear, without checks", "nalgebra_3"),
    ("adskalman 0.18, linear", "adskalman_3"),
    ("typed-kalman 0.1, linear", "typed_kalman_3"),
    ("kfilter 0.5, linear", "kfilter_3"),
    ("minikalman 0.8, linear", "minikalman_3"),
    ("typed-kalman UKF, linear", "typed_kalman_ukf_3"),
    ("kfilter UKF, linear", "kfilter_ukf_3"),
];

/// Returns the table of nanoseconds per step; what was not measured is left out.
pub fn steps(builds: &[Build]) -> String {
    let mut out = header("one step (three states unless said), ns", builds);
    for (words, name) in STEPS {
        let name = format!("step/{name}");
        if builds.iter().any(|build| build.ns(&name).is_some()) {
            row(&mut out, words, builds.iter().map(|build| cell(build.ns(&name), 1)));
        }
    }
    out
}

const SMOOTHERS: [(&str, &str); 3] = [
    ("smoother, in place", "smoother_3"),
    ("adskalman 0.18's", "adskalman_smoother_3"),
    ("typed-kalman 0.1's", "typed_kalman_smoother_3"),
];

/// Returns the table of rows and passes per second.
pub fn recordings(builds: &[Build]) -> String {
    let mut out = header("filter and smoother over 10 000 rows, million rows a second", builds);
    let per_second = |build: &Build, name: &str, scale: f64| build.ns(name).map(|ns| 1e9 / ns / scale);
    for (words, name) in SMOOTHERS {
        let name = format!("recording/{name}");
        if builds.iter().any(|build| build.ns(&name).is_some()) {
            row(&mut out, words, builds.iter().map(|build| cell(per_second(build, &name, 1e6), 2)));
        }
    }
    out.push('\n');
    out += &header("one EKF pass over 3000 simulated rows, five states, passes a second", builds);
    for (words, name) in [("generic", "pass/generic_5"), ("sparse", "pass/sparse_5")] {
        row(&mut out, words, builds.iter().map(|build| cell(per_second(build, name, 1.0), 0)));
    }
    out
}

/// Returns the table of bytes; all builds have the same, so the first one's are shown.
pub fn memory(builds: &[Build]) -> String {
    let mut out = "| smoother, three states | peak heap, B a row (target) |\n|---|--:|\n".to_owned();
    for (words, name) in SMOOTHERS {
        if let Some(bytes) = builds.first().and_then(|build| build.bytes(name)) {
            let target = if name.ends_with("smoother_3") && !name.contains("kalman") { " (≤ 80)" } else { "" };
            row(&mut out, words, [format!("{bytes:.0}{target}")].into_iter());
        }
    }
    out
}

fn header(first: &str, builds: &[Build]) -> String {
    let levels: Vec<&str> = builds.iter().map(|build| build.level.as_str()).collect();
    let columns = first.split('|').count();
    let rule = "---|".repeat(columns) + &"--:|".repeat(levels.len());
    format!("| {first} | {} |\n|{rule}\n", levels.join(" | "))
}

fn row(out: &mut String, first: &str, cells: impl Iterator<Item = String>) {
    // Writing into a string cannot fail.
    let _ = writeln!(out, "| {first} | {} |", cells.collect::<Vec<_>>().join(" | "));
}

fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "not measured".to_owned(), |value| format!("{value:.digits$}"))
}
