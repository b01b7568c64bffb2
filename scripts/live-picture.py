#!/usr/bin/env python3
"""Draws docs/live.svg: twenty seconds of `live` in a terminal, as an animated SVG.

scripts/live-picture.py PROGRAM [SVG]

PROGRAM is the command line. It simulates a recording, calibrates on its first 200 s and plays the rest back at four times
its speed. Needs pyte (`pip install pyte`), a terminal emulator.
"""

import fcntl
import html
import os
import pty
import re
import select
import struct
import subprocess
import sys
import tempfile
import termios
import time
from itertools import groupby
from pathlib import Path

import pyte

ROWS, COLUMNS = 24, 96
# Seconds before the first screen, of all screens, and of one.
WAITS_S, LASTS_S, EVERY_S = 8.0, 20.0, 0.8
CELL_WIDTH, CELL_HEIGHT, MARGIN = 8, 17, 12
BACKGROUND, FOREGROUND = "#14171c", "#d5d9e0"
COLOURS = {
    "black": "#5c6370",
    "red": "#e06c75",
    "green": "#98c379",
    "brown": "#e5c07b",
    "blue": "#61afef",
    "magenta": "#c678dd",
    "cyan": "#56b6c2",
    "white": "#d5d9e0",
    "brightblack": "#7f848e",
    "brightwhite": "#ffffff",
}


def screens(command, folder):
    """Screens of the program, one every EVERY_S: each a tuple of rows, each row a tuple of (text, colour, bold)."""
    screen = pyte.Screen(COLUMNS, ROWS)
    stream = pyte.ByteStream(screen)
    child, terminal = pty.fork()
    if child == 0:
        try:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            os.chdir(folder)
            os.environ["TERM"] = "xterm-256color"
            os.execv(command[0], command)
        finally:
            os._exit(127)
    start, found = time.monotonic(), []
    while len(found) < round(LASTS_S / EVERY_S):
        due = start + WAITS_S + EVERY_S * len(found)
        while (left := due - time.monotonic()) > 0:
            if select.select([terminal], [], [], left)[0]:
                stream.feed(os.read(terminal, 65536))
        found.append(tuple(runs(screen.buffer[row]) for row in range(ROWS)))
    os.write(terminal, b"q")
    try:
        while os.read(terminal, 65536):
            pass
    except OSError:  # The program has closed its end.
        pass
    _, status = os.waitpid(child, 0)
    if status:
        sys.exit(f"{' '.join(command)}: expected it to end well, found status {status}")
    return found


def runs(cells):
    """Runs of one style in a row, without blanks at its end."""
    row = [(cells[column].data, cells[column].fg, cells[column].bold) for column in range(COLUMNS)]
    while row and row[-1][0] == " ":
        row.pop()
    styled = groupby(row, key=lambda cell: cell[1:])
    return tuple(("".join(cell[0] for cell in group), *style) for style, group in styled)


def drawn(row, runs):
    """Text elements of a row: one for each piece between two blanks or more, since SVG makes one blank of them."""
    column, texts = 0, []
    for text, colour, bold in runs:
        for piece in re.finditer(r"\S+(?: \S+)*", text):
            x, y = MARGIN + (column + piece.start()) * CELL_WIDTH, MARGIN + (row + 0.75) * CELL_HEIGHT
            fill = "" if colour == "default" else f' fill="{COLOURS.get(colour) or "#" + colour}"'
            weight = ' font-weight="bold"' if bold else ""
            width = len(piece[0]) * CELL_WIDTH
            texts.append(f'<text x="{x}" y="{y:g}" textLength="{width}"{fill}{weight}>{html.escape(piece[0])}</text>')
        column += len(text)
    return "".join(texts)


def animated(screens):
    """The SVG. A row is drawn once for each time that it stays as it is."""
    width, height = 2 * MARGIN + COLUMNS * CELL_WIDTH, 2 * MARGIN + ROWS * CELL_HEIGHT
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
        f' font-family="ui-monospace,Menlo,Consolas,DejaVu Sans Mono,monospace" font-size="13" fill="{FOREGROUND}">',
        "<title>ohmstrain live: a recording is played back</title>",
        f'<rect width="{width}" height="{height}" rx="8" fill="{BACKGROUND}"/>',
    ]
    for row in range(ROWS):
        first = 0
        for runs, same in groupby(screen[row] for screen in screens):
            last = first + len(list(same))
            texts = drawn(row, runs)
            if texts and last - first == len(screens):
                lines.append(texts)
            elif texts:
                times = [first / len(screens), last / len(screens)]
                values, keys = ["hidden", "visible", "hidden"], [0, *times]
                if first == 0:
                    values, keys = values[1:], keys[1:]
                if last == len(screens):
                    values, keys = values[:-1], keys[:-1]
                # Where nothing is animated the last screen stands.
                still = "visible" if last == len(screens) else "hidden"
                lines.append(
                    f'<g visibility="{still}"><animate attributeName="visibility" dur="{LASTS_S:g}s" repeatCount="indefinite"'
                    f' calcMode="discrete" values="{";".join(values)}" keyTimes="{";".join(f"{key:g}" for key in keys)}"/>{texts}</g>'
                )
            first = last
    return "\n".join([*lines, "</svg>", ""])


def main(program, svg="docs/live.svg"):
    program = str(Path(program).resolve())
    with tempfile.TemporaryDirectory() as folder:
        run = lambda *words: subprocess.run([program, "-q", *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        run("example", "-o", "trace.csv")
        run("calibrate", "trace.csv", "--until", "200", "-o", "sensor.toml")
        rows = (Path(folder) / "trace.csv").read_text().splitlines(keepends=True)
        kept = [row for row in rows if not row[0].isdigit() or float(row.split(",")[0]) >= 200]
        (Path(folder) / "bench.csv").write_text("".join(kept))
        command = [program, "live", "--port", "bench.csv", "--speed", "4", "--sensor", "sensor.toml"]
        Path(svg).write_text(animated(screens(command, folder)))


if len(sys.argv) not in (2, 3):
    sys.exit(__doc__)
main(*sys.argv[1:])
