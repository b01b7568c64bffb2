#!/usr/bin/env bash
# What the filters make of faults, in Rust and as exported C: prints docs/faults.md.
#
#   faults.sh > docs/faults.md
#
# Needs a C compiler; takes minutes.
#
# Environment:
#   OHMSTRAIN  the program; default: built by cargo
#   CC         the compiler; default: cc
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

ohmstrain=${OHMSTRAIN:-}
if [[ -z $ohmstrain ]]; then
    cargo build --quiet --locked -p ohmstrain-cli
    ohmstrain=$PWD/target/debug/ohmstrain
fi

# exported NAME FLAG...: exports the sensor of the sweep and compiles its replay.
exported() {
    local folder=$work/$1
    "$ohmstrain" export --sensor tests/fixtures/representative.toml --target c --dt-s 0.05 -o "$folder" "${@:2}" >/dev/null
    "${CC:-cc}" -std=c99 -O2 -ffp-contract=off -I"$folder/src" "$folder/src/ohmstrain.c" "$folder/selftest/replay.c" \
        -lm -o "$folder/replay"
}

exported default
exported lean --budget lean
cargo run --quiet --locked -p ohmstrain-tests --example faults -- "default, C=$work/default/replay" "lean, C=$work/lean/replay"
