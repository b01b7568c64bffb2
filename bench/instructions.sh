#!/usr/bin/env bash
# Counts the instructions of a step of every filter with callgrind and compares them with instructions.toml, where the
# rule stands.
#
#   instructions.sh           fails if the rule is broken
#   instructions.sh --update  writes the figures into instructions.toml instead
#
# Needs valgrind (installed if missing and root). No benchmark harness in between: gungraun, which iai-callgrind has
# become, needs a runner of exactly its own version installed beside it, and its limits do not know compilers.
set -euo pipefail
cd "$(dirname "$0")"

if ! command -v valgrind >/dev/null; then
    ../scripts/apt.sh valgrind
fi

# The same code on every machine, whatever the surroundings ask for.
export RUSTFLAGS="-C target-cpu=x86-64"
export CARGO_TARGET_DIR=target/x86-64
# The C library chooses its exponentials, logarithms and copies by processor.
export GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-AVX512VL,-FMA,-FMA4,-ERMS,-FSRM
cargo build --quiet --locked --profile bench -p ohmstrain-bench-filters --bin instructions
readonly program=$CARGO_TARGET_DIR/release/instructions
readonly counts=$CARGO_TARGET_DIR/instructions.txt

for name in $("$program" list); do
    log=$CARGO_TARGET_DIR/callgrind.log
    steps=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='*counted*' \
        --log-file="$log" "$program" run "$name")
    instructions=$(sed -n 's/.*Collected : \([0-9]*\).*/\1/p' "$log")
    echo "$name ${instructions:?callgrind counted nothing} $steps"
done >"$counts"

rustc=$(rustc --version | cut -d' ' -f2)
"$program" judge instructions.toml "$counts" "$rustc" "$@"
