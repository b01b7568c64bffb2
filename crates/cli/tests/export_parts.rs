//! Exported C of sensors with and without each optional part: it compiles strictly, describes the sensor correctly, and passes
//! its self-test without a difference.

use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use toml::{Table, Value};

use crate::common::Bench;
use crate::export::{compile, compilers, run_program};

/// Name of a part, and its variants.
type Part = (&'static str, &'static [&'static str]);

const PARTS: [Part; 12] = [
    ("estimator", &["corrected sign-split", "corrected hypotheses", "sign-split", "hypotheses", "ekf", "static-cubic"]),
    ("rest", &["never", "at the lower end", "at the upper end", "between"]),
    ("branches", &["2", "0", "1", "3", "4"]),
    ("gauge", &["polynomial", "decaying-exponential", "tunnelling"]),
    ("quantity", &["strain", "angle", "ratio", "joint"]),
    ("hold", &["rests", "never rests"]),
    ("baseline", &["wanders", "none"]),
    ("directions", &["two", "one"]),
    ("limits", &["from zero", "away from zero"]),
    ("rate", &["any", "of a phase"]),
    ("evidence", &["whole", "tempered"]),
    ("readings", &["err apart", "err alike, never repeat"]),
];

/// One variant of each part, by index.
type Choice = [usize; PARTS.len()];

/// Returns choices in which every two variants of two parts occur together: each covers as many of the remaining pairs as
/// possible.
fn all_pairs() -> Vec<Choice> {
    let forms = |part: usize| 0..PARTS[part].1.len();
    let mut left = Vec::new();
    for a in 0..PARTS.len() {
        for b in a + 1..PARTS.len() {
            left.extend(forms(a).flat_map(|x| forms(b).map(move |y| ((a, x), (b, y)))));
        }
    }
    let mut choices = Vec::new();
    while let Some(&((a, x), (b, y))) = left.first() {
        let mut chosen: [Option<usize>; PARTS.len()] = [None; PARTS.len()];
        (chosen[a], chosen[b]) = (Some(x), Some(y));
        for part in 0..PARTS.len() {
            let taken = |form: usize, chosen: &[Option<usize>]| {
                let is = |(at, of): (usize, usize)| chosen[at] == Some(of);
                let pair = |&&(one, two): &&((usize, usize), (usize, usize))| {
                    (one == (part, form) && is(two)) || (two == (part, form) && is(one))
                };
                left.iter().filter(pair).count()
            };
            if chosen[part].is_none() {
                chosen[part] = forms(part).rev().max_by_key(|form| taken(*form, &chosen));
            }
        }
        let choice: Choice = chosen.map(Option::unwrap);
        left.retain(|&((a, x), (b, y))| !(choice[a] == x && choice[b] == y));
        choices.push(choice);
    }
    choices
}

/// The sensor of a choice.
struct Variant {
    choice: Choice,
    sensor: Table,
}

impl Variant {
    /// Creates it from a calibrated sensor with other parameters.
    fn new(choice: Choice) -> Self {
        let text = include_str!("../../../tests/fixtures/representative.toml");
        let mut variant = Self { choice, sensor: text.parse().unwrap() };
        for of_calibration in ["summary", "uncertainty", "recordings"] {
            variant.sensor.remove(of_calibration);
        }
        variant.change_estimators();
        variant.change_law();
        variant.change_rest();
        variant.change_quantity();
        variant
    }

    fn form(&self, part: &str) -> &'static str {
        let place = PARTS.iter().position(|(name, _)| *name == part).unwrap();
        PARTS[place].1[self.choice[place]]
    }

    fn is(&self, part: &str, form: &str) -> bool {
        self.form(part) == form
    }

    fn estimator(&self) -> &'static str {
        self.form("estimator").split(' ').next().unwrap()
    }

    fn change_estimators(&mut self) {
        let (never_rests, tempered) = (self.is("hold", "never rests"), self.is("evidence", "tempered"));
        let (of_phase, no_baseline) = (self.is("rate", "of a phase"), self.is("baseline", "none"));
        let alike = self.is("readings", "err alike, never repeat");
        if alike {
            self.table("validity").insert("longest_repeat_s".into(), 0.0.into());
        }
        let corrects = self.form("estimator").split(' ').nth(1);
        match corrects {
            Some(corrects) => drop(self.table("correction").insert("corrects".into(), corrects.into())),
            None => drop(self.sensor.remove("correction")),
        }
        self.sensor.insert("default_estimator".into(), self.estimator().into());
        let estimators = self.table("estimators");
        let histories = estimators["hypotheses"].clone();
        estimators.insert("sign-split".into(), histories);
        for (_, estimator) in estimators.iter_mut() {
            let estimator = estimator.as_table_mut().unwrap();
            let noise = estimator["noise"].as_table_mut().unwrap();
            noise.insert("reading_time_s".into(), if alike { 2.4 } else { 0.0 }.into());
            if no_baseline {
                noise.insert("baseline_sd".into(), 0.0.into());
            }
            let Some(phases) = estimator.get_mut("phases").and_then(Value::as_table_mut) else { continue };
            if never_rests {
                phases.insert("reversal".into(), 1.0.into());
            }
            phases.insert("speed_per_s".into(), if of_phase { 0.05 } else { 0.0 }.into());
            phases.insert("tempering".into(), if tempered { 0.5 } else { 1.0 }.into());
        }
    }

    fn change_law(&mut self) {
        let (branches, gauge) = (self.form("branches").parse().unwrap(), self.form("gauge"));
        let one_direction = self.is("directions", "one");
        let law = self.table("law");
        let mut all = law["branches"].as_array().unwrap().clone();
        for k in all.len()..branches {
            let mut another = all[k - 2].clone();
            another["tau_s"] = (7.0 * another["tau_s"].as_float().unwrap()).into();
            all.push(another);
        }
        all.truncate(branches);
        if one_direction {
            law.insert("retract_viscosity_s".into(), law["extend_viscosity_s"].clone());
            for branch in &mut all {
                branch["retract_gain"] = branch["extend_gain"].clone();
                branch["retract_gain_slope"] = branch["extend_gain_slope"].clone();
            }
        }
        law.insert("branches".into(), all.into());
        let curve = match gauge {
            "decaying-exponential" => "family = 'decaying-exponential'\nslope = 3.0\ndecay_strain = 0.25",
            "tunnelling" => "family = 'tunnelling'\ngap = 0.8\nbarrier = 1.2\npath_loss = -2.0",
            _ => return,
        };
        law.insert("gauge".into(), Value::Table(curve.parse().unwrap()));
    }

    fn change_rest(&mut self) {
        let rested = match self.form("rest") {
            "at the lower end" => Some(3199.661),
            "at the upper end" => Some(8000.0),
            "between" => Some(5500.0),
            _ => None,
        };
        self.sensor.remove("measured_rest");
        if let Some(rested) = rested {
            self.sensor.insert("measured_rest".into(), rested.into());
        }
        if self.is("limits", "away from zero") {
            self.table("limits").insert("lower".into(), 0.1.into());
        }
    }

    fn change_quantity(&mut self) {
        match self.form("quantity") {
            "angle" => drop(self.sensor.insert("quantity".into(), "angle_deg".into())),
            "joint" => {
                let joint = "prestrain = 0.02\nmoment_arm_mm = 10.0\ngauge_length_mm = 30.0";
                self.sensor.insert("joint".into(), Value::Table(joint.parse().unwrap()));
            }
            "ratio" => self.divide_readings(3200.0),
            _ => {}
        }
    }

    fn divide_readings(&mut self, by: f64) {
        self.sensor.insert("reading".into(), "ratio".into());
        let divide = |table: &mut Table, names: &[&str]| {
            for name in names {
                if let Some(number) = table.get_mut(*name) {
                    *number = (number.as_float().unwrap() / by).into();
                }
            }
        };
        divide(&mut self.sensor, &["rest_reading", "measured_rest"]);
        divide(self.table("validity"), &["reading_lower", "reading_upper"]);
        divide(self.table("static_cubic"), &["reading_centre", "reading_scale"]);
    }

    fn table(&mut self, name: &str) -> &mut Table {
        self.sensor[name].as_table_mut().unwrap()
    }

    /// Returns all variants, for a message.
    fn name(&self) -> String {
        PARTS.iter().map(|(part, _)| format!("{part} {}", self.form(part))).collect::<Vec<_>>().join(", ")
    }

    /// Exports it and runs the self-test with every compiler; one of them, if there is one, looks at the rest.
    fn check(&self, bench: &Bench, compiler: Option<&str>) {
        let name = self.name();
        bench.write("sensor.toml", toml::to_string(&self.sensor).unwrap());
        let export = ["export", "--sensor", "sensor.toml", "--dt-s", "0.05", "--target", "c", "-o", "c", "--force"];
        let run = bench.run(&export);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{name}");
        self.check_words(bench);
        let folder = bench.path("c");
        for compiler in compilers() {
            println!("{compiler}: {name}");
            let sources = ["src/ohmstrain.c", "selftest/selftest.c"];
            let tested = run_program(&compile(compiler, &folder, &sources, "selftest.out"), "", &[]);
            assert!(tested.starts_with("largest difference: 0 of "), "{compiler}, {name}: {tested}");
        }
        let Some(compiler) = compiler else { return };
        let check_syntax = |compiler: &str, arguments: &[&str]| {
            let strict = ["-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-Isrc"];
            let checked = Command::new(compiler).current_dir(&folder).args(strict).args(arguments).output().unwrap();
            assert!(checked.status.success(), "{compiler}, {name}: {}", String::from_utf8_lossy(&checked.stderr));
        };
        check_syntax(compiler, &["-std=c99", "-pedantic", "selftest/replay.c"]);
        let sketch = "examples/ohmstrain_plotter/ohmstrain_plotter.ino";
        let arduino = ["-std=gnu++11", "-I", STAND_INS, "-include", "Arduino.h", "-x", "c++", sketch];
        check_syntax(if compiler == "gcc" { "g++" } else { "clang++" }, &arduino);
        for (example, headers) in EXAMPLES {
            check_syntax(compiler, &["-std=c99", &format!("-I{STAND_INS}/{headers}"), example]);
        }
    }

    /// Checks the text on the sensor's rest and on zero strain.
    fn check_words(&self, bench: &Bench) {
        let (readme, header) = (bench.read("c/README.md"), bench.read("c/src/ohmstrain.h"));
        let never = self.is("rest", "never");
        assert_eq!(readme.contains("In calibration the sensor never rested"), never, "{}", self.name());
        assert_eq!(readme.contains("In calibration the rested, unstretched sensor read"), !never, "{}", self.name());
        assert_eq!(header.contains("in calibration it did not rest"), never, "{}", self.name());
        let at_zero = self.is("limits", "from zero");
        assert_eq!(readme.contains("restarts the filter at zero"), at_zero, "{}", self.name());
        assert_eq!(header.contains("the filter restarts at zero"), at_zero, "{}", self.name());
    }
}

/// Stand-ins: for Arduino, and in folders of it for ST's HAL and for Zephyr.
const STAND_INS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/exported-c");
/// Examples in C, and the folder of the headers that stand in for theirs.
const EXAMPLES: [(&str, &str); 2] =
    [("examples/stm32_hal/ohmstrain_app.c", "stm32"), ("examples/zephyr/src/main.c", "zephyr/include")];

/// The same functions of the same numbers in the same order. Only the exponentials of two libraries could differ, and both
/// languages call that of the host. The compilers take turns with what is not run.
#[test]
fn exported_c_of_any_two_parts_together_compiles_strictly_and_is_the_rust_filter() {
    let choices = all_pairs();
    let mut forms = PARTS.map(|(_, forms)| forms.len());
    forms.sort_unstable();
    // Each variant of one of the two largest parts occurs with each of the other.
    let least = forms[PARTS.len() - 1] * forms[PARTS.len() - 2];
    assert!(choices.len() >= least && choices.len() < 2 * least, "{}", choices.len());
    let compilers = compilers();
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let bench = Bench::new();
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(choice) = choices.get(place) else { break };
                    let compiler = compilers.get(place % compilers.len().max(1)).copied();
                    Variant::new(*choice).check(&bench, compiler);
                }
            });
        }
    });
}
