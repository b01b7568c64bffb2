#!/usr/bin/env python3
"""Error and cost of the filters that `export --budget` chooses from: the table of docs/chip.md, that of its note, and a figure.

scripts/smaller-filters.py PROGRAM FOLDER
scripts/smaller-filters.py --draw

PROGRAM is the command line, FOLDER holds the public recordings that docs/accuracy.md names. Each case is calibrated on its first half;
`export --budget lean --score` runs every candidate over it in single precision, and scores the second half. This is done with the
recordings as they are, and again with noise added to the readings. Takes twenty minutes. With --draw, docs/smaller-filters.svg is
drawn from the table as it stands, and nothing is measured.
"""

import argparse
import csv
import math
import random
import re
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "chip.md"
NOTE = DOCS / "notes/2026-11-28-smaller-filters.md"
FIGURE = DOCS / "smaller-filters.svg"
BEGIN, END = "<!-- made by scripts/smaller-filters.py -->\n", "<!-- end -->\n"
#: Instructions a step of `--budget lean`.
LEAN = 15_000

MIXED = ("--material", "representative", "--protocol", "mixed", "--speed-mm-s", 5, "--mismatched")
#: Named before any was measured: words of `simulate`, or the name of a recording.
CASES = {
    "simulated, seed 1, 20 Hz": (*MIXED, "--seed", 1, "--sample-rate-hz", 20),
    "simulated, seed 11, 10 Hz": (*MIXED, "--seed", 11, "--sample-rate-hz", 10),
    "simulated, seed 12, 10 Hz": (*MIXED, "--seed", 12, "--sample-rate-hz", 10),
    "simulated, seed 13, 10 Hz": (*MIXED, "--seed", 13, "--sample-rate-hz", 10),
    "sine": "cbs-slow-sine",
    "short ramps": "cbs-short-ramps",
    "triangles": "cbs-triangles",
    "six-sine": "cbs-multisine",
    "sawtooth": "cbs-sawtooth",
    "knee": "knee-bend",
}
#: How often each case is measured, and the standard deviation of the noise that is added from the second time on, as a share of a reading:
#: it can change which law and filter are chosen.
DRAWS, NOISE = 4, 2e-4
#: Rows of the whole correction.
ALL = "200"
DEFAULT, EKF = ("8", ALL), ("EKF", "none")
HEAD = [
    "| hypotheses | rows | error | each time | worst | instructions | flash, B | within 15 000 | place |",
    "|---|---|--:|--:|--:|--:|--:|--:|--:|",
]
NOTE_HEAD = ["| case | default | | `lean` | | `lean` with `--score` | | EKF |", "|---|---|--:|---|--:|---|--:|--:|"]


@dataclass
class Candidate:
    """A row of the table that `export --budget` prints."""

    words: str
    #: Error on the second half, %FS.
    error: float
    instructions: int
    flash: int

    @property
    def size(self):
        """Hypotheses, and rows of the correction."""
        hypotheses = re.search(r"(\d+) hypotheses", self.words)
        rows = re.search(r"correction of (\d+) rows", self.words)
        return hypotheses[1] if hypotheses else "EKF", rows[1] if rows else "none"

    @property
    def name(self):
        """Kind, hypotheses and rows."""
        kind = "histories" if self.words.startswith("hypotheses") else self.words.split(",")[0]
        return "EKF" if self.size == EKF else f"{kind}, {'/'.join(self.size)}"


def run(program, *words, cwd):
    done = subprocess.run([program, "-q", *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def add_noise(trace, seed):
    """Multiplies all readings of a file by 1 and noise."""
    noise = random.Random(seed)
    with open(trace, encoding="utf-8") as file:
        lines = file.read().splitlines()
    head = next(number for number, line in enumerate(lines) if not line.startswith("#"))
    at = next(column for column, name in enumerate(lines[head].split(",")) if name.startswith("resistance"))
    for number in range(head + 1, len(lines)):
        cells = lines[number].split(",")
        if cells[at]:
            cells[at] = f"{float(cells[at]) * (1 + NOISE * noise.gauss(0, 1)):.8g}"
        lines[number] = ",".join(cells)
    trace.write_text("\n".join(lines) + "\n", encoding="utf-8")


def measured(program, recordings, case, draw):
    """Candidates of a case by their sizes, in the order in which `--budget` prefers them."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder, "trace.csv")
        if isinstance(case, str):
            trace.write_bytes(Path(recordings, f"{case}.csv").read_bytes())
        else:
            run(program, "simulate", *case, "-o", trace, cwd=folder)
        if draw:
            add_noise(trace, draw)
        with open(trace, encoding="utf-8") as file:
            times = [row["time_s"] for row in csv.DictReader(line for line in file if not line.startswith("#"))]
        half = times[len(times) // 2]
        run(program, "calibrate", trace, "--until", half, "-o", "sensor.toml", cwd=folder)
        words = ("--sensor", "sensor.toml", "--target", "c", "-o", "c", "--budget", "lean", "--score", trace, "--from", half)
        # A choice that is worse than a static cubic is measured, too.
        out = run(program, "export", *words, "--force", cwd=folder)
    lines = [line for line in out.split("\n| estimate")[0].split("\n") if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[1:]]
    found = [Candidate(of[0], float(of[1]), int(of[2]), int(of[3])) for of in cells]
    if DEFAULT not in (one.size for one in found):
        sys.exit(f"{case}, draw {draw}: the default is {found[0].words}, which has no smaller filters to compare")
    return {one.size: one for one in found}


def lean(found):
    """The choices of `--budget lean`: without `--score`, and with it."""
    fit = [one for one in found.values() if one.instructions <= LEAN]
    return fit[0], min(fit, key=lambda one: one.error)


def row(name, chosen, draws, *more):
    """Mean error of the candidates chosen in each case of each draw, and their row of the table."""
    errors = [[one.error / found[DEFAULT].error for one, found in zip(*pair, strict=True)] for pair in zip(chosen, draws, strict=True)]
    means = [statistics.geometric_mean(of) for of in errors]
    everyone = [one for of in chosen for one in of]
    costs = [f"{statistics.median(of):.0f}" for of in ([one.instructions for one in everyone], [one.flash for one in everyone])]
    fit = 100 * sum(one.instructions <= LEAN for one in everyone) / len(everyone)
    mean, worst = statistics.geometric_mean(means), max(map(max, errors))
    figures = [f"{mean:.2f}", ", ".join(f"{of:.2f}" for of in means), f"{worst:.2f}", *costs, f"{fit:.0f} %"]
    return mean, "| " + " | ".join([*name, *figures, *more]) + " |"


def page_table(draws):
    """Lines of the table of the page, the least mean error first, and the choices within 15 000 instructions."""
    rows = []
    for place, size in enumerate(draws[0][0], start=1):
        left = size[1] if size[1] in (ALL, "none") else f"{size[1]} and a quadratic function"
        rows.append(row((size[0], left), [[found[size] for found in cases] for cases in draws], draws, str(place)))
    for which, name in enumerate(("`lean`", "`lean` with `--score`")):
        chosen = [[lean(found)[which] for found in cases] for cases in draws]
        rows.append((math.inf, row((name, ""), chosen, draws, "")[1]))
    return HEAD + [line for _, line in sorted(rows, key=lambda row: row[0])]


def note_table(cases):
    """Lines of the table of the note: what is chosen in each case, and its error."""
    lines = []
    for name, found in cases.items():
        cells = [cell for one in (found[DEFAULT], *lean(found)) for cell in (one.name, f"{one.error:.2f}")]
        lines.append("| " + " | ".join([name, *cells, f"{found[EKF].error:.2f}"]) + " |")
    return NOTE_HEAD + lines


def write(path, lines):
    text = path.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    path.write_text("".join([before, BEGIN, "\n".join(lines), "\n", END, after]), encoding="utf-8")


COLOURS = {ALL: "#1f4e9c", "48": "#1786b5", "32": "#2a8055", "8": "#b86e00", "none": "#a8324a"}
WIDTH, HEIGHT = 900, 890
INSTRUCTIONS, FLASH = "thousands of instructions a step, Cortex-M4F", "flash, kB"


@dataclass
class Axis:
    """Pixels of values, on a scale of their logarithms or not."""

    title: str
    ticks: tuple
    #: Values at the two ends, and their pixels.
    values: tuple
    pixels: tuple
    is_log: bool = True

    def __call__(self, value):
        first, last, at = (math.log(of) if self.is_log else of for of in (*self.values, value))
        return round(self.pixels[0] + (at - first) / (last - first) * (self.pixels[1] - self.pixels[0]), 1)


def text(x, y, words, **style):
    attributes = "".join(f' {name.replace("_", "-")}="{value}"' for name, value in style.items())
    return f'<text x="{x}" y="{y}"{attributes}>{words}</text>'


def lines_of(points, colour, width):
    """A line through points in pixels."""
    return f'<polyline points="{" ".join(f"{x},{y}" for x, y in points)}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def front(points):
    """Corners of the line below which no point is."""
    corners, least = [], math.inf
    for x, y in sorted(points):
        if y < least:
            corners += [(x, least), (x, y)] if corners else [(x, y)]
            least = y
    return corners


def grid(x, y):
    """Axes, their ticks and titles."""
    left, right, bottom, top = *x.pixels, *y.pixels
    for tick in y.ticks:
        yield lines_of([(left, y(tick)), (right, y(tick))], "#e8e8e8", 1)
        yield text(left - 7, y(tick) + 4, f"{tick:g}", text_anchor="end")
    for tick in x.ticks:
        yield lines_of([(x(tick), bottom), (x(tick), bottom + 5)], "black", 1)
        yield text(x(tick), bottom + 18, f"{tick:g}", text_anchor="middle")
    yield lines_of([(left, top), (left, bottom), (right, bottom)], "black", 1)
    yield text((left + right) / 2, bottom + 36, x.title, text_anchor="middle")
    yield text(left, top - 10, y.title)
    if x.title == INSTRUCTIONS:
        at = x(LEAN / 1000)
        yield f'<path d="M{at} {bottom}V{top}" stroke="#666" stroke-dasharray="2 3"/>'


def panel(x, y, points, radius=7):
    """One drawing of (name, rows kept, x, y); a dot's number is that of the hypotheses."""
    yield from grid(x, y)
    points = [(name, rows, x(across), y(up)) for name, rows, across, up in points]
    # Larger pixels are smaller errors.
    corners = front([(across, -up) for name, _, across, up in points if name != "lean"])
    yield lines_of([(across, -up) for across, up in corners], "#c4c4c4", 6)
    for rows, colour in COLOURS.items():
        yield lines_of(sorted(point[2:] for point in points if point[1] == rows and point[0].isdigit()), colour, 0.8)
    for name, rows, across, up in points:
        if name.isdigit():
            yield f'<circle cx="{across}" cy="{up}" r="{radius}" fill="{COLOURS[rows]}" stroke="white" stroke-width="0.7"/>'
            yield text(across, up + radius / 2, name, text_anchor="middle", fill="white", font_size=1.5 * radius, font_weight="bold")
        else:
            colour = COLOURS.get(rows, "black")
            yield f'<path d="M{across} {up - 7}l7 7l-7 7l-7 -7z" fill="{colour}" stroke="white"/>'
        named = {DEFAULT: "default", EKF: "EKF", ("lean", ""): "lean"}.get((name, rows))
        if named == "EKF":
            yield text(across - 7, up - 12, named)
        elif named == "lean":
            yield text(across - 11, up + 4, named, text_anchor="end")
        elif named:
            yield text(across + 11, up + 4, named)


def legend(left, top):
    yield text(left, top, "number: hypotheses; colour: rows of the correction")
    for row, (rows, colour) in enumerate(COLOURS.items(), start=1):
        at = top + 20 * row
        yield f'<circle cx="{left + 15}" cy="{at - 4}" r="7" fill="{colour}"/>'
        kept = {ALL: f"{ALL}, all", "none": "no correction"}.get(rows, f"{rows} and a quadratic function")
        yield text(left + 38, at, kept)
    at = top + 20 * (len(COLOURS) + 1)
    yield lines_of([(left, at - 4), (left + 30, at - 4)], "#c4c4c4", 6)
    yield text(left + 38, at, "best for its cost")


def table_rows():
    """Of each row of the table: name, rows kept, mean and worst error, thousands of instructions and kB of flash."""
    table = PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0].strip().split("\n")[len(HEAD) :]
    for line in table:
        name, rows, error, _, worst, instructions, flash, *_ = (cell.strip() for cell in line.strip("|").split("|"))
        yield name, rows.split(" ")[0], float(error), float(worst), int(instructions) / 1000, int(flash) / 1000


def upwards(ticks, least, most):
    """Ticks and ends of an axis from `least` to above `most`."""
    return [tick for tick in ticks if tick <= 1.12 * most], (least, 1.12 * most)


def draw():
    """Draws the figure from the table of the page."""
    rows = list(table_rows())
    sizes = [row for row in rows if row[0].isdigit() or row[0] == "EKF"]
    # It stands at its limit, as its filters differ from case to case.
    at_lean = [("lean", "", LEAN / 1000, row[2]) for row in rows if row[0] == "`lean`"]
    costs = ((2, 5, 10, 15, 20, 50, 100), (1.7, 130))
    means = upwards([1 + 0.1 * of for of in range(20)], 0.97, max(row[2] for row in sizes))
    worsts = upwards((1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10), 0.95, max(row[3] for row in sizes))
    flashes = (range(10, 81, 10), (10, 86))
    parts = [
        panel(
            Axis(INSTRUCTIONS, *costs, (55, 880)),
            Axis("error relative to the default's, geometric mean", *means, (405, 30)),
            [(name, kept, cost, error) for name, kept, error, _, cost, _ in sizes] + at_lean,
        ),
        legend(75, 255),
        panel(
            Axis(INSTRUCTIONS, *costs, (55, 575)),
            Axis("the worst case", *worsts, (840, 490)),
            [(name, kept, cost, error) for name, kept, _, error, cost, _ in sizes],
            radius=5,
        ),
        panel(
            Axis(FLASH, *flashes, (650, 880), is_log=False),
            Axis("geometric mean again, and flash", *means, (840, 490)),
            [(name, kept, flash, error) for name, kept, error, _, _, flash in sizes],
            radius=5,
        ),
    ]
    head = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="12">',
        "<title>Error and cost of smaller filters</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    drawn = [line for part in parts for line in part]
    FIGURE.write_text("\n".join([*head, *drawn, "</svg>"]) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?")
    parser.add_argument("folder", nargs="?")
    parser.add_argument("--draw", action="store_true")
    given = parser.parse_args()
    if not given.draw:
        if not given.folder:
            parser.error("expected PROGRAM and FOLDER, or --draw")
        program, draws = str(Path(given.program).resolve()), []
        for draw_number in range(DRAWS):
            draws.append({})
            for name, case in CASES.items():
                found = draws[-1][name] = measured(program, given.folder, case, draw_number)
                print(f"{draw_number}, {name}, %FS:", ", ".join(f"{one.name} {one.error}" for one in found.values()), flush=True)
        write(PAGE, page_table([list(cases.values()) for cases in draws]))
        write(NOTE, note_table(draws[0]))
    draw()


if __name__ == "__main__":
    main()
