#!/usr/bin/env bash
# Compiles the self-test of an exported folder for an ATmega328P (Uno, Nano) with the flags of Arduino's core, -flto included, and
# runs it in simavr. Prints what it prints; fails unless it passes.
#
#   uno.sh FOLDER
#
# Needs Debian's gcc-avr, avr-libc and simavr.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

avr-gcc -mmcu=atmega328p -DF_CPU=16000000L -Os -std=gnu11 -flto -ffunction-sections -fdata-sections -Wall -Wextra -Werror -Wl,--gc-sections \
    -I"$folder/src" -I"$folder/selftest" "$here/avr.c" "$folder/src/ohmstrain.c" -lm -o "$work/selftest.elf"
# It colours what the UART says, ends lines with dots, and waits for a debugger after a crash.
timeout 60 simavr -m atmega328p -f 16000000 "$work/selftest.elf" </dev/null 2>&1 | tr -d '\033' | sed -E 's/\[[0-9]+m//g; s/\.+\r?$//' >"$work/output" || true
grep -E 'cycles a step|largest difference|self-test' "$work/output"
grep -q 'self-test passed' "$work/output"
