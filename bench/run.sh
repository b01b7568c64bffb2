#!/usr/bin/env bash
# Times everything in two builds and writes README.md. Ten minutes on a machine that does nothing else.
#
#   run.sh          the figures to publish
#   run.sh --quick  short measurements: whether it works
#
# The second build needs a processor with AVX2 and FMA, and is left out on others.
set -euo pipefail
cd "$(dirname "$0")"

times=(--warm-up-time 0.5 --measurement-time 2 --sample-size 50)
mode="2 s and 50 samples a figure"
if [[ ${1:-} == --quick ]]; then
    times=(--warm-up-time 0.1 --measurement-time 0.3 --sample-size 10)
    mode="**quick mode, 0.3 s and 10 samples a figure: not for quoting**"
fi

levels=(x86-64)
if grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo; then levels+=(x86-64-v3); fi

# At real-time priority, where that is allowed, company slows a figure down but does not interrupt it.
quiet=()
if chrt -f 1 true 2>/dev/null; then quiet=(chrt -f 1 taskset -c "$(($(nproc) - 1))"); mode="$mode, at real-time priority on one core"; fi

directories=()
for level in "${levels[@]}"; do
    export RUSTFLAGS="-C target-cpu=$level"
    export CARGO_TARGET_DIR=$PWD/target/$level
    export CRITERION_HOME=$CARGO_TARGET_DIR/criterion
    # A benchmark that no longer exists must not stay in the table.
    rm -rf "$CRITERION_HOME"
    cargo bench --locked -p ohmstrain-bench-comparison --benches --no-run
    "${quiet[@]}" cargo bench --locked -p ohmstrain-bench-comparison --benches -- --noplot "${times[@]}"
    # One process measures: more than 1 says that it had company.
    load=$(cut -d' ' -f1 /proc/loadavg)
    cargo run --quiet --locked --profile bench -p ohmstrain-bench-comparison --bin memory >"$CARGO_TARGET_DIR/memory.txt"
    directories+=("$CARGO_TARGET_DIR")
done
cargo run --quiet --locked --profile bench -p ohmstrain-bench-comparison --bin report -- \
    README.md "$mode; load average at the end $load" "${directories[@]}"
