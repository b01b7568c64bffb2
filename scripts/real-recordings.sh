#!/usr/bin/env bash
# What the filter reaches on real recordings, as a Markdown table on stdout.
#
#   real-recordings.sh FOLDER [FLAG OF evaluate...]
#   e.g. real-recordings.sh recordings --estimator sign-split
#
# FOLDER holds trace CSVs with a reference. Each one is calibrated on the first half of its rows and scored on the second.
# Filters of phase hypotheses take minutes on long recordings.
set -euo pipefail
shopt -s nullglob

traces=("${1:-}"/*.csv)
if [[ $# -lt 1 || ! -d $1 || ${#traces[@]} -eq 0 ]]; then
    echo "usage: $(basename "$0") FOLDER [FLAG OF evaluate...], with CSV files in FOLDER" >&2
    exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
exec cargo run --release --locked --quiet --manifest-path "$root/Cargo.toml" -- evaluate --split 0.5 "${@:2}" "${traces[@]}"
