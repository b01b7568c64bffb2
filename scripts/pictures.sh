#!/usr/bin/env bash
# Draws the pictures of the front page: docs/strain.svg, a figure of `evaluate` on the recording of `example`.
#
#   pictures.sh           writes docs/strain.svg
#   pictures.sh --live    writes docs/live.svg, too (live-picture.py, which needs pyte)
#   pictures.sh --check   compares docs/strain.svg with what the program draws
#
# Environment:
#   OHMSTRAIN  the program; default: target/release/ohmstrain
set -euo pipefail
cd "$(dirname "$0")/.."
case ${1:-} in
'' | --live | --check) ;;
*)
    echo "expected --live, --check or nothing, found $1" >&2
    exit 2
    ;;
esac
ohmstrain=$(realpath "${OHMSTRAIN:-target/release/ohmstrain}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
(
    cd "$work"
    "$ohmstrain" -q example -o trace.csv
    "$ohmstrain" -q calibrate trace.csv --until 200 -o sensor.toml
    "$ohmstrain" -q evaluate trace.csv --sensor sensor.toml --from 200 --figures figures >/dev/null
)
if [[ ${1:-} == --check ]]; then
    cmp "$work/figures/strain-against-time.svg" docs/strain.svg || {
        echo "docs/strain.svg is not what the program draws: look at the difference, then run scripts/pictures.sh" >&2
        exit 1
    }
else
    cp "$work/figures/strain-against-time.svg" docs/strain.svg
fi
[[ ${1:-} != --live ]] || scripts/live-picture.py "$ohmstrain"
