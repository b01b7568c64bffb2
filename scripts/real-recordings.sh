#!/usr/bin/env bash
# What the filter reaches on real recordings, as a Markdown table on stdout.
#
#   real-recordings.sh FOLDER [ESTIMATOR]
#
# FOLDER holds trace CSVs with a reference (`NAME.csv`). Each one is calibrated on its first half (the rows before its
# middle row) and scored on its second half. The recordings are public but not part of this repository; a name that is
# listed below is described by its source and protocol, any other by itself. ESTIMATOR is ekf unless given; filters of phase
# hypotheses take minutes on long recordings. Progress goes to stderr.
set -euo pipefail
shopt -s nullglob

if [[ $# -lt 1 || $# -gt 2 || ! -d $1 ]]; then
    echo "usage: $(basename "$0") FOLDER [ESTIMATOR]" >&2
    exit 2
fi
folder=$1
estimator=${2:-ekf}
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

ohmstrain() { cargo run --release --locked --quiet --manifest-path "$root/Cargo.toml" -- "$@"; }

# Source and protocol of a recording, by the name of its file.
describe() {
    case $1 in
        cbs-four-speeds) echo "carbon black/silicone ᵃ: 0 to 20 %, 300 s holds and rests, four speeds" ;;
        cbs-multisine) echo "carbon black/silicone ᵃ: random six-sine, 0 to 30 %" ;;
        cbs-sawtooth) echo "carbon black/silicone ᵃ: sawtooth of random size and rate" ;;
        cbs-short-ramps) echo "carbon black/silicone ᵃ: short ramps to 30 %" ;;
        cbs-slow-sine) echo "carbon black/silicone ᵃ: sine 0 to 30 %, period 30 s" ;;
        cbs-step-hold-7wt) echo "carbon black/silicone ᵃ: steps to 10, 20, 30 %, 20 to 300 s holds, 7.5 wt-%" ;;
        cbs-step-hold-10wt) echo "carbon black/silicone ᵃ: steps to 10, 20, 30 %, 20 to 300 s holds, 10 wt-%" ;;
        cbs-triangles) echo "carbon black/silicone ᵃ: triangles at several speeds, 10 % prestrain" ;;
        nylon-sine) echo "silver-coated nylon ᵇ: sine 0 to 96 %, 20 mHz" ;;
        nylon-triangle) echo "silver-coated nylon ᵇ: triangle 0 to 96 %, 20 mHz" ;;
        knee-bend) echo "graphene knit on a knee ᶜ: bends to 90°, angle by motion capture" ;;
        *) echo "$1" ;;
    esac
}

# Time of the middle row, as it stands in the file.
middle_time() {
    awk -F, '
        /^#/ { next }
        !time { for (i = 1; i <= NF; i++) if ($i == "time_s") time = i; if (!time) exit 1; next }
        { times[n++] = $time }
        END { print times[int(n / 2)] }
    ' "$1"
}

# Cells of the table that `evaluate` prints, of the row with that estimate: %FS and coverage.
scores() {
    awk -F'|' -v estimate="$1" '
        { for (i = 1; i <= NF; i++) gsub(/^ +| +$/, "", $i) }
        $3 ~ "^" estimate { printf "%.1f", $5; if ($7 != "") { sub(/ %/, "", $7); printf " (%.0f)", $7 } }
    ' "$work/scores"
}

echo "| recording | static cubic | filter | smoother |"
echo "|---|---|---|---|"
for trace in "$folder"/*.csv; do
    name=$(basename "$trace" .csv)
    echo "$name" >&2
    middle=$(middle_time "$trace") || { echo "$trace: no column time_s" >&2; exit 1; }
    ohmstrain calibrate "$trace" --until "$middle" --estimator "$estimator" --output "$work/sensor.toml"
    ohmstrain evaluate "$trace" --sensor "$work/sensor.toml" --from "$middle" >"$work/scores"
    echo "| $(describe "$name") | $(scores "static cubic") | $(scores "$estimator") | $(scores smoother) |"
done
