#!/usr/bin/env bash
# Writes tests/released/VERSION, once for each version that is published: a sensor, readings, its estimates and its filter exported as C and as Rust.
# Tests read, run and compile them for good.
#
#   released.sh
#
# Environment:
#   OHMSTRAIN  the program of that version; default: target/release/ohmstrain
set -euo pipefail
cd "$(dirname "$0")/.."
ohmstrain=$(realpath "${OHMSTRAIN:-target/release/ohmstrain}")
folder=$PWD/tests/released/$("$ohmstrain" --version | cut -d' ' -f2)
mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$ohmstrain" -q simulate --protocol mixed --speed-mm-s 5 --sample-rate-hz 1 --mismatched -o trace.csv
"$ohmstrain" -q calibrate trace.csv --until 120 -o "$folder/sensor.toml" --force
# The hundred rows after those of the calibration, without the strain.
grep -v '^#' trace.csv | cut -d, -f1,2 | sed -n '1p;122,221p' >"$folder/readings.csv"
for command in filter smooth; do
    "$ohmstrain" -q "$command" "$folder/readings.csv" --sensor "$folder/sensor.toml" --columns time_s,strain,strain_sd -o "$folder/$command.csv" --force
done
"$ohmstrain" -q export --sensor "$folder/sensor.toml" --estimator ekf --target c --dt-s 0.1 -o c >/dev/null
"$ohmstrain" -q export --sensor "$folder/sensor.toml" --estimator ekf --target rust --dt-s 0.1 -o rust >/dev/null
rm -rf "$folder/c" "$folder/rust"
mkdir -p "$folder/c/src" "$folder/c/selftest" "$folder/rust"
cp c/src/ohmstrain.[ch] "$folder/c/src"
cp c/selftest/selftest.c c/selftest/vectors.h "$folder/c/selftest"
cp rust/sensor.rs "$folder/rust"
