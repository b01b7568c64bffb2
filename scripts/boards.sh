#!/usr/bin/env bash
# Compiles the examples of boards/, with a sensor of this repository. Nothing is run: the board that runs is QEMU's.
#
#   boards.sh
#
# Needs the target thumbv7em-none-eabihf from rustup; says so where it cannot be had.
#
# Environment:
#   OHMSTRAIN  the program; default: built by cargo
set -euo pipefail
cd "$(dirname "$0")/.."
readonly target=thumbv7em-none-eabihf

if ! timeout 60 rustup target add "$target" >/dev/null 2>&1; then
    echo "NOT COMPILED: boards/, since $target cannot be had from rustup here" >&2
    exit 0
fi
ohmstrain=${OHMSTRAIN:-}
if [[ -z $ohmstrain ]]; then
    cargo build --quiet --locked -p ohmstrain-cli
    ohmstrain=$PWD/target/debug/ohmstrain
fi
"$ohmstrain" export --sensor tests/fixtures/representative.toml --target rust --dt-s 0.05 -o target/boards/sensor >/dev/null
cp target/boards/sensor/sensor.rs boards/stm32/src/sensor.rs
readonly folder=$PWD/target/boards
(cd boards/stm32 && cargo fmt --check && RUSTFLAGS="-D warnings" cargo build --quiet --locked --release --target-dir "$folder")
echo "boards/stm32: compiled and linked, $(wc -c <"$folder/$target/release/ohmstrain-stm32") B with symbols"
