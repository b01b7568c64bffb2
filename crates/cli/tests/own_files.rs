//! Recognition of the program's own files, which it replaces: by whole headers and marks, not by a slight likeness.

use std::fs;

use crate::common::{Bench, ESTIMATES_HEADER, files_in};

fn estimate<'a>(command: &'a str, output: &'a str) -> [&'a str; 6] {
    [command, "trace.csv", "--sensor", "sensor.toml", "-o", output]
}

/// A recording is not taken for estimates if its column names begin like those of estimates, or are some of them.
#[test]
fn a_recording_is_not_taken_for_estimates() {
    let bench = Bench::calibrated();
    let headers = [
        "time_s,resistance_ohm,strain_pct",
        "time_s,resistance_ohm,strain,p_kpa",
        "time_s,resistance_ohm,angle_rate_ref",
        "time_s,resistance_ohm,strain,baseline_ohm",
        "time_s,resistance_ohm,strain,strain_rate",
        "time_s,resistance_ohm,strain,flags",
        "time_s,index_deg,index_sd_deg,flags",
        &ESTIMATES_HEADER.replace(",nis", ""),
        &format!("{ESTIMATES_HEADER},comment"),
    ];
    for header in headers {
        let content = format!("{header}\n{}\n", header.replace(|c: char| c != ',', "").replace(',', "1,") + "1");
        bench.write("mine.csv", &content);
        for command in ["filter", "smooth"] {
            let run = bench.run(&estimate(command, "mine.csv"));
            assert_eq!(run.code, Some(2), "{header}: {}", run.stderr);
            assert!(run.stderr.contains("something else than estimates"), "{}", run.stderr);
        }
        assert_eq!(bench.read("mine.csv"), content);
    }
    let columns = ["--columns", "time_s,strain_sd,strain"];
    bench.write("mine.csv", "time_s,strain,strain_sd\n0,0,0\n");
    assert_eq!(bench.run(&[&estimate("filter", "mine.csv")[..], &columns].concat()).code, Some(2));
    bench.write("mine.csv", format!("{ESTIMATES_HEADER}\n"));
    bench.run(&estimate("filter", "mine.csv")).ok();
}

/// A table of this program that does not contain estimates, also in Parquet.
#[test]
fn a_summary_is_not_taken_for_estimates_nor_these_for_it() {
    let bench = Bench::calibrated();
    let batch = ["-q", "batch", "filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out"];
    for form in ["parquet", "csv", "json"] {
        let batch = [&batch[..], &["--summary", form]].concat();
        let summary = format!("out/summary.{form}");
        bench.run(&batch).ok();
        let made = fs::read(bench.path(&summary)).unwrap();
        assert_eq!(bench.run(&estimate("smooth", &summary)).code, Some(2));
        bench.run(&batch).ok();
        // Another program's file of the same name stays.
        let estimates = format!("mine.{form}");
        bench.run(&estimate("smooth", &estimates)).ok();
        fs::rename(bench.path(&estimates), bench.path(&summary)).unwrap();
        let mine = fs::read(bench.path(&summary)).unwrap();
        let run = bench.run(&batch);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains("something else than a summary"), "{}", run.stderr);
        assert!(fs::read(bench.path(&summary)).unwrap() == mine && mine != made);
        bench.run(&[&batch[..], &["--force"]].concat()).ok();
    }
}

#[test]
fn a_journal_of_somebody_else_stays() {
    let bench = Bench::calibrated();
    let batch = ["-q", "batch", "filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out"];
    fs::create_dir(bench.path("out")).unwrap();
    for mine in ["{\"made_by\": \"another batch\"}\n", "notes\n", "{\"command\"", "\u{fffd}\n"] {
        bench.write("out/batch.jsonl", mine);
        let run = bench.run(&batch);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains("cannot write out/batch.jsonl: no earlier run wrote"), "{}", run.stderr);
        assert_eq!((bench.read("out/batch.jsonl").as_str(), files_in(&bench.path("out")).len()), (mine, 1));
    }
    bench.run(&[&batch[..], &["--force"]].concat()).ok();
    assert!(bench.read("out/batch.jsonl").starts_with("{\"command\":"));
    bench.run(&batch).ok();
}

#[test]
fn a_manifest_names_nothing_outside_of_the_folder() {
    let bench = Bench::calibrated();
    let batch = |command, columns: &str, cell: &str| {
        bench.write("list.csv", format!("file,{columns}\ntrace.csv,\ntrace.csv,{cell}\n"));
        let sensor = if command == "calibrate" { vec![] } else { vec!["--sensor", "sensor.toml"] };
        bench.run(&[&["-q", "batch", command, "--manifest", "list.csv", "-o", "out"], &sensor[..]].concat())
    };
    let absolute = bench.path("x.csv").display().to_string();
    for cell in ["../x.csv", "a/../../x.csv", "a/../x.csv", &absolute, "."] {
        for (command, column) in
            [("filter", "output"), ("calibrate", "sensor"), ("evaluate", "report"), ("calibrate", "figures")]
        {
            let message = format!(
                "list.csv:3: column `{column}`: expected a name below the folder of outputs (-o), found `{cell}`"
            );
            batch(command, column, cell).fails(4, &message);
        }
    }
    assert!(!bench.path("out").exists());
    assert_eq!(batch("filter", "output", "./b.csv").code, Some(0));
    assert!(bench.path("out/b.csv").is_file());
    // The names of the summary and the journal are reserved.
    assert!(batch("evaluate", "output", "summary.json").stderr.contains("name of the summary"));
    // One report of two recordings.
    let flags =
        ["batch", "evaluate", "trace.csv", "--sensor", "sensor.toml", "-o", "out", "--", "--report", "out/r.html"];
    assert_eq!(bench.run(&flags).code, Some(2));
}

#[test]
fn a_page_of_a_manual_is_replaced_if_it_is_ours() {
    let bench = Bench::new();
    for _ in 0..2 {
        bench.run(&["man", "-o", "man"]).ok();
    }
    bench.write("man/ohmstrain-filter.1", ".TH mine 1\n");
    assert_eq!(bench.run(&["man", "-o", "man"]).code, Some(2));
    assert_eq!(bench.read("man/ohmstrain-filter.1"), ".TH mine 1\n");
    bench.run(&["man", "-o", "man", "--force"]).ok();
}

/// Figures and exports are replaced in their folder; files that only mention this program stay.
#[test]
fn figures_and_exports_are_known_by_their_marks() {
    let bench = Bench::calibrated();
    let figures = ["-q", "evaluate", "trace.csv", "--sensor", "sensor.toml", "--figures", "figs", "--report", "r.html"];
    let export = |target| ["export", "--sensor", "sensor.toml", "--target", target, "--dt-s", "0.2", "-o", target];
    for _ in 0..2 {
        bench.run(&figures).code.filter(|code| *code == 0).unwrap();
        ["c", "rust"].iter().for_each(|target| drop(bench.run(&export(target)).ok()));
    }
    let figure = files_in(&bench.path("figs")).into_iter().find(|name| name.ends_with(".csv")).unwrap();
    let mine = [
        (format!("figs/{figure}"), "# Generated by ohmstrain 0.1.0 and corrected by hand\n1,2\n"),
        ("c/README.md".to_owned(), "# My glove\n\nGenerated by ohmstrain 0.1.0: see src.\n"),
        ("rust/sensor.rs".to_owned(), "//! Mine, once Generated by ohmstrain 0.1.0; do not edit.\n"),
        ("r.html".to_owned(), "<html><!-- <meta name=\"generator\" content=\"ohmstrain 0.1.0\"> --></html>\n"),
    ];
    for (path, content) in &mine {
        let before = fs::read(bench.path(path)).unwrap();
        bench.write(path, content);
        let target = path.split('/').next().unwrap();
        let is_export = ["c", "rust"].contains(&target);
        let run = if is_export { bench.run(&export(target)) } else { bench.run(&figures) };
        assert_eq!(run.code, Some(2), "{path}: {}", run.stderr);
        assert_eq!(bench.read(path), *content);
        bench.write(path, before);
    }
}

#[cfg(unix)]
mod on_unix {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_linked_summary_and_output_stay_links() {
        let bench = Bench::calibrated();
        let batch = ["-q", "batch", "filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out"];
        fs::create_dir(bench.path("out")).unwrap();
        symlink("../summary.csv", bench.path("out/summary.csv")).unwrap();
        symlink("../there.csv", bench.path("out/trace.csv")).unwrap();
        for _ in 0..2 {
            bench.run(&batch).ok();
            for link in ["out/summary.csv", "out/trace.csv"] {
                assert!(fs::symlink_metadata(bench.path(link)).unwrap().is_symlink(), "{link}");
            }
            assert!(bench.read("summary.csv").starts_with("file,") && bench.read("there.csv").starts_with("time_s,"));
        }
        bench.write("summary.csv", "mine\n");
        assert_eq!(bench.run(&batch).code, Some(2));
        assert_eq!(bench.read("summary.csv"), "mine\n");
    }
}

/// `-` means stdout where rows or a recording are printed, and is invalid elsewhere.
#[test]
fn no_file_is_called_like_stdout() {
    let bench = Bench::calibrated();
    let before = bench.files();
    for command in ["filter", "smooth"] {
        let printed = bench.run(&[command, "trace.csv", "--sensor", "sensor.toml"]).ok();
        assert_eq!(bench.run(&estimate(command, "-")).ok(), printed);
    }
    let simulate = ["simulate", "--sample-rate-hz", "1"];
    assert_eq!(bench.run(&[&simulate[..], &["-o", "-"]].concat()).ok(), bench.run(&simulate).ok());
    let rest = ["--sensor", "sensor.toml"];
    let commands: [&[&str]; 10] = [
        &["calibrate", "trace.csv", "-o", "-"],
        &["calibrate", "trace.csv", "-o", "x.toml", "--report", "-"],
        &["calibrate", "trace.csv", "-o", "x.toml", "--figures", "-"],
        &["evaluate", "trace.csv", "--report", "-"],
        &["refine", "trace.csv", "-o", "-"],
        &["fleet", "fit", "sensor.toml", "sensor.toml", "sensor.toml", "-o", "-"],
        &["export", "--target", "c", "--dt-s", "0.2", "-o", "-"],
        &["demo", "--out", "-"],
        &["batch", "filter", "trace.csv", "-o", "-"],
        &["man", "-o", "-"],
    ];
    for arguments in commands {
        let with_sensor = ["evaluate", "refine", "export", "batch"].contains(&arguments[0]);
        let run = bench.run(&[arguments, if with_sensor { &rest } else { &[] }].concat());
        assert_eq!(run.code, Some(2), "{}: {}", run.command, run.stderr);
        assert!(run.stderr.starts_with("ohmstrain: cannot write -: expected a file or a folder"), "{}", run.stderr);
    }
    assert_eq!(bench.files(), before);
}
