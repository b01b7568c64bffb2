//! The report in a headless browser: no message on its console, nothing wider than a phone, values under the pointer, plots
//! that can be enlarged; and figures that look as they did when a person last approved them.
//!
//! Without Chromium they test nothing, and say so on stderr; with `OHMSTRAIN_REQUIRE_CHROMIUM=1`, as in `.ci/run`, they fail. After a wanted change of a
//! figure: `OHMSTRAIN_FINGERPRINTS=DIR cargo test -p ohmstrain-cli --test all browser::` writes the pictures to DIR for somebody to
//! look at, and the new fingerprints to `tests/fingerprints`.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::Bench;

/// Names under which Chromium goes.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// The browser, if there is one or none is required.
fn browser() -> Option<PathBuf> {
    let path = env::var_os("PATH").unwrap_or_default();
    let found =
        env::split_paths(&path).flat_map(|folder| NAMES.map(|name| folder.join(name))).find(|file| file.is_file());
    if found.is_none() {
        let missing = "the report is not tested: no chromium (scripts/chromium.sh installs it)";
        assert!(env::var_os("OHMSTRAIN_REQUIRE_CHROMIUM").is_none(), "{missing}");
        // Not by a macro: the output of macros is shown for failing tests only.
        let _ = writeln!(io::stderr(), "{missing}");
    }
    found
}

/// Opens a page, and returns the browser's stdout. A message on the console is a failure.
fn open(browser: &Path, bench: &Bench, page: &str, arguments: &[&str]) -> String {
    let profile = format!("--user-data-dir={}", bench.path("profile").display());
    let usual = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        "--log-level=0",
    ];
    let mut command = Command::new(browser);
    command.args(usual).args([profile.as_str(), "--virtual-time-budget=3000"]).args(arguments);
    let done = command.arg(format!("file://{}", bench.path(page).display())).output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    let complaints: Vec<&str> = stderr.lines().filter(|line| line.contains("CONSOLE")).collect();
    assert!(done.status.success() && complaints.is_empty(), "{page}: {complaints:?}\n{stderr}");
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Returns a folder with a report, `report.html`, and its figures, of a recording without randomness.
fn reported() -> Bench {
    let bench = Bench::new();
    // Not calibrated here, since the comparison is of the drawing.
    bench.write("sensor.toml", include_str!("../../ohmstrain/examples/sensor.toml"));
    bench.run(&[&crate::common::SIMULATE[..7], &["-o", "trace.csv"]].concat()).ok();
    let flags = ["evaluate", "trace.csv", "--sensor", "sensor.toml", "--report", "report.html", "--figures", "figures"];
    bench.run(&flags).ok();
    bench
}

/// Moves the pointer over the first plot, drags over its middle, and goes back; the title contains the results.
const SCRIPT: &str = "<script>addEventListener('load', () => {
  const svg = document.querySelector('.plot > svg'), box = svg.getBoundingClientRect(), data = svg.querySelector('g.data');
  const send = (kind, share, target) => target.dispatchEvent(new PointerEvent(kind, { bubbles: true, pointerType: 'mouse',
    button: 0, clientX: box.left + share * box.width, clientY: box.top + box.height / 2 }));
  send('pointermove', .5, svg);
  const value = document.querySelector('.plot .value').textContent;
  send('pointerdown', .4, svg); send('pointermove', .5, svg); send('pointerup', .5, svg);
  const zoomed = data.getAttribute('transform'), ticks = svg.querySelectorAll('.zoomed text').length;
  svg.dispatchEvent(new MouseEvent('dblclick'));
  const back = data.getAttribute('transform');
  document.title = JSON.stringify({ value, zoomed, ticks, back, wide: document.documentElement.scrollWidth,
    window: innerWidth, dark: getComputedStyle(document.body).backgroundColor,
    hint: getComputedStyle(document.querySelector('figcaption'), '::after').content,
    cut: svg.parentNode.scrollWidth > svg.parentNode.clientWidth });
});</script></body>";

#[test]
fn the_report_works_on_every_screen() {
    let Some(browser) = browser() else { return };
    let bench = reported();
    let page = bench.read("report.html").replace("</body>", SCRIPT);
    bench.write("tried.html", page);
    for (scheme, size, background) in [
        ("1", "--window-size=1100,900", "rgb(255, 255, 255)"),
        ("0", "--window-size=1100,900", "rgb(21, 24, 27)"),
        ("0", "--window-size=500,900", "rgb(21, 24, 27)"),
    ] {
        let scheme = format!("--blink-settings=preferredColorScheme={scheme}");
        let dom = open(&browser, &bench, "tried.html", &[&scheme, size, "--dump-dom"]);
        let title = dom.split("<title>").nth(1).unwrap().split("</title>").next().unwrap();
        let found: serde_json::Value = serde_json::from_str(title).unwrap_or_else(|_| panic!("{title}"));
        assert_eq!(found["dark"], background);
        let pixels = |name: &str| found[name].as_f64().unwrap();
        assert!(pixels("wide") <= pixels("window"), "{found}");
        // The recording is 400 s long; the pointer is at its middle, apart from the axis labels on the left.
        let value = found["value"].as_str().unwrap();
        let time_s: f64 = value.split(" | ").next().unwrap().parse().unwrap();
        assert!((150.0..250.0).contains(&time_s), "{found}");
        assert!(found["zoomed"].as_str().unwrap().contains("scale(") && found["ticks"] == 10, "{found}");
        assert_eq!(found["back"], "", "{found}");
        // A plot that is wider than the screen shows a hint.
        assert_eq!(found["hint"].as_str().unwrap().contains("slide"), found["cut"] == true, "{found}");
        assert_eq!(found["cut"], size.contains("500"), "{found}");
    }
}

#[test]
fn the_report_is_complete_without_scripts() {
    let Some(browser) = browser() else { return };
    let bench = reported();
    let page = bench.read("report.html");
    let (before, script) = page.split_once("<script>").unwrap();
    bench.write("still.html", format!("{before}{}", script.split_once("</script>").unwrap().1));
    let dom = open(&browser, &bench, "still.html", &["--dump-dom"]);
    for words in ["Strain against time", "Hysteresis loop", "Relaxation while held", "static cubic"] {
        assert!(dom.contains(words), "{words}");
    }
}

/// The printed report's figures share pages, and folded parts are left out.
#[test]
fn the_report_prints_on_few_pages() {
    let Some(browser) = browser() else { return };
    let bench = reported();
    let pdf = bench.path("report.pdf");
    open(&browser, &bench, "report.html", &["--no-pdf-header-footer", &format!("--print-to-pdf={}", pdf.display())]);
    let bytes = fs::read(pdf).unwrap();
    let pages = bytes.split(|byte| *byte == b'\n').filter(|line| line.ends_with(b"/Type /Page")).count();
    assert!((3..=5).contains(&pages), "{pages}");
}

/// The approved figures.
const LOOKED_AT: [&str; 9] = [
    "strain-against-time",
    "error-against-time",
    "readings-and-fit",
    "hysteresis-loop",
    "loops-by-speed",
    "gauge-curve",
    "held-levels",
    "relaxation-while-held",
    "rate-of-relaxation",
];
/// Cells of a fingerprint across and down.
const CELLS: (usize, usize) = (24, 12);
/// Largest difference of a cell's mean brightness, 0 to 255, from the approved one. Other fonts move letters within a cell;
/// another compiler or processor moves a line by less than a pixel. A missing line or a different axis changes dozens of cells
/// by more, and a different picture most of them.
const CELL_TOLERANCE: f64 = 12.0;
const CELLS_BEYOND: usize = 6;

/// Returns the mean brightness of the cells.
fn fingerprint(png: &[u8]) -> Vec<f64> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let (width, height, samples) = (info.width as usize, info.height as usize, info.color_type.samples());
    let (mut sums, mut counts) = (vec![0.0; CELLS.0 * CELLS.1], vec![0.0; CELLS.0 * CELLS.1]);
    for y in 0..height {
        for x in 0..width {
            let colours = &pixels[(y * width + x) * samples..][..3];
            let cell = y * CELLS.1 / height * CELLS.0 + x * CELLS.0 / width;
            sums[cell] += colours.iter().map(|colour| f64::from(*colour)).sum::<f64>() / 3.0;
            counts[cell] += 1.0;
        }
    }
    sums.iter().zip(&counts).map(|(sum, count)| sum / count).collect()
}

#[test]
fn figures_look_as_they_did_when_somebody_looked() {
    let Some(browser) = browser() else { return };
    let bench = reported();
    let pictures = env::var_os("OHMSTRAIN_FINGERPRINTS").map(PathBuf::from);
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fingerprints");
    let files = crate::common::files_in(&bench.path("figures"));
    for name in LOOKED_AT {
        let name = files.iter().find(|file| **file == format!("{name}.svg")).unwrap_or_else(|| panic!("{name}"));
        let picture = bench.path("picture.png");
        let flag = format!("--screenshot={}", picture.display());
        open(&browser, &bench, &format!("figures/{name}"), &[&flag, "--window-size=760,420"]);
        let png = fs::read(&picture).unwrap();
        let name = name.trim_end_matches(".svg");
        let (found, file) = (fingerprint(&png), kept.join(format!("{name}.txt")));
        if let Some(folder) = &pictures {
            fs::create_dir_all(folder).unwrap();
            fs::create_dir_all(&kept).unwrap();
            fs::write(folder.join(format!("{name}.png")), &png).unwrap();
            let row = |row: &[f64]| row.iter().map(|x| format!("{x:.0}")).collect::<Vec<_>>().join(" ") + "\n";
            fs::write(&file, found.chunks(CELLS.0).map(row).collect::<String>()).unwrap();
        }
        let Ok(text) = fs::read_to_string(&file) else { panic!("no fingerprint of {name}: nobody has looked at it") };
        let wanted: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let beyond = found.iter().zip(&wanted).filter(|(a, b)| (*a - *b).abs() > CELL_TOLERANCE).count();
        assert!(found.len() == wanted.len() && beyond <= CELLS_BEYOND, "{name}: {beyond} cells look otherwise");
    }
}

/// A fingerprint detects differences that a person would notice.
#[test]
fn a_fingerprint_tells_figures_apart() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fingerprints");
    let read = |name: &str| -> Vec<f64> {
        let text = fs::read_to_string(kept.join(format!("{name}.txt"))).unwrap();
        text.split_whitespace().map(|word| word.parse().unwrap()).collect()
    };
    let (strain, readings) = (read("strain-against-time"), read("readings-and-fit"));
    let beyond = strain.iter().zip(&readings).filter(|(a, b)| (*a - *b).abs() > CELL_TOLERANCE).count();
    assert!(beyond > 2 * CELLS_BEYOND, "{beyond}");
}
