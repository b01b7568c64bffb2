#!/usr/bin/env bash
# What the filter reaches on real recordings, as Markdown tables on stdout.
#
#   real-recordings.sh FOLDER [FLAG OF evaluate...]
#   e.g. real-recordings.sh recordings --estimator sign-split
#        real-recordings.sh recordings --splits 0.4,0.5,0.65,reversed --json > results.json
#
# FOLDER holds trace CSVs with a reference. Each one is calibrated on the first half of its rows and scored on the second,
# unless --splits says otherwise; a table of all cases together follows the one of each. --json keeps everything, with
# version and hashes. Filters of phase hypotheses take minutes on long recordings.
set -euo pipefail
shopt -s nullglob

traces=("${1:-}"/*.csv)
if [[ $# -lt 1 || ! -d $1 || ${#traces[@]} -eq 0 ]]; then
    echo "usage: $(basename "$0") FOLDER [FLAG OF evaluate...], with CSV files in FOLDER" >&2
    exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
splits=(--splits 0.5)
for flag in "${@:2}"; do
    case $flag in --split | --split=* | --splits | --splits=*) splits=() ;; esac
done
exec cargo run --release --locked --quiet --manifest-path "$root/Cargo.toml" -- evaluate "${splits[@]}" "${@:2}" "${traces[@]}"
