#!/usr/bin/env bash
# Compiles the examples of boards/, with a sensor of this repository. Nothing is run: the board that runs is QEMU's.
#
#   boards.sh
#
# Needs the targets thumbv7em-none-eabihf and riscv32imc-unknown-none-elf from rustup; says so where one cannot be had.
#
# Environment:
#   OHMSTRAIN  the program; default: built by cargo
set -euo pipefail
cd "$(dirname "$0")/.."
ohmstrain=${OHMSTRAIN:-}
if [[ -z $ohmstrain ]]; then
    cargo build --quiet --locked -p ohmstrain-cli
    ohmstrain=$PWD/target/debug/ohmstrain
fi
"$ohmstrain" export --sensor tests/fixtures/representative.toml --target rust --dt-s 0.05 -o target/boards/sensor >/dev/null
readonly folder=$PWD/target/boards

# compiled BOARD TARGET
compiled() {
    if ! timeout 60 rustup target add "$2" >/dev/null 2>&1; then
        echo "NOT COMPILED: boards/$1, since $2 cannot be had from rustup here" >&2
        return
    fi
    cp "$folder/sensor/sensor.rs" "boards/$1/src/sensor.rs"
    (cd "boards/$1" && cargo fmt --check &&
        RUSTFLAGS="-D warnings" cargo build --quiet --locked --release --target-dir "$folder")
    echo "boards/$1: compiled and linked, $(wc -c <"$folder/$2/release/ohmstrain-$1") B with symbols"
}

compiled stm32 thumbv7em-none-eabihf
compiled esp32c3 riscv32imc-unknown-none-elf
