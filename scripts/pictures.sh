#!/usr/bin/env bash
# Draws the pictures of the front page: docs/strain.svg, a figure of `evaluate` on the recording of `example`, and with --live
# docs/live.svg (live-picture.py, which needs pyte). --check compares docs/strain.svg with what the program draws.
#
#   pictures.sh [--check|--live]
#
# Environment:
#   OHMSTRAIN  the program; default: target/release/ohmstrain
set -euo pipefail
cd "$(dirname "$0")/.."
ohmstrain=$(realpath "${OHMSTRAIN:-target/release/ohmstrain}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
(
    cd "$work"
    "$ohmstrain" -q example -o trace.csv
    "$ohmstrain" -q calibrate trace.csv --until 200 -o sensor.toml
    "$ohmstrain" -q evaluate trace.csv --sensor sensor.toml --from 200 --figures figures >/dev/null
)
case ${1:-} in
--check) diff -q "$work/figures/strain-against-time.svg" docs/strain.svg ;;
*) cp "$work/figures/strain-against-time.svg" docs/strain.svg ;;
esac
[[ ${1:-} != --live ]] || scripts/live-picture.py "$ohmstrain"
