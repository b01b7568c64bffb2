#!/usr/bin/env bash
# Builds the firmware, runs it in QEMU, compares with the f64 filters and with budgets.toml, where the rule stands.
#
#   run.sh           fails if the rule is broken or the replayed codes are not what is generated; with the compiler that
#                    budgets.toml names, also if README.md is not
#   run.sh --update  writes the codes, README.md and the figures of budgets.toml instead
#
# Needs qemu-system-arm and binutils-arm-none-eabi (installed if missing and root).
set -euo pipefail
cd "$(dirname "$0")"

readonly programs=(ekf3 ekf3_varying fast3 fast3_varying ekf6 fast6 fast_imm6 fast_split6)
readonly images=target/images
update=0
[[ ${1:-} != --update ]] || update=1

if ! command -v qemu-system-arm >/dev/null || ! command -v arm-none-eabi-nm >/dev/null; then
    ../scripts/apt.sh qemu-system-arm binutils-arm-none-eabi
fi

host() { cargo run --quiet --locked -p ohmstrain-embedded-host -- "$@"; }

if ((update)); then host vectors .; else host vectors . --check; fi

mkdir -p "$images"
for profile in release small; do
    BARE_METAL_TARGET_DIR=target/bare ../scripts/bare-metal.sh --profile "$profile" --locked \
        -p ohmstrain-firmware --bins
    for program in "${programs[@]}"; do
        elf=target/bare/thumbv7em-none-eabihf/$profile/$program
        stem=$images/$profile-$program
        arm-none-eabi-nm -S "$elf" >"$stem.nm"
        arm-none-eabi-objdump -d "$elf" >"$stem.dis"
        arm-none-eabi-size -A "$elf" >"$stem.size"
        timeout 60 qemu-system-arm -M mps2-an386 -icount shift=0 -nographic -monitor none -serial none \
            -semihosting-config enable=on,target=native -kernel "$elf" </dev/null >"$stem.out"
        # Which of the two compilers bare-metal.sh found, each signs what it makes.
        arm-none-eabi-readelf -p .comment "$elf" | sed -n 's/.*\(rustc version .*\)/\1/p' >"$images/compiler"
    done
done

if ((update)); then host report . "$images" --update; else host report . "$images"; fi
