#!/usr/bin/env bash
# Compiles and links the sketch of an exported folder with Arduino's own core, for a Mega 2560; prints what it takes.
#
#   arduino-avr.sh FOLDER
#
# Needs Debian's gcc-avr, avr-libc and arduino-core-avr. arduino-cli would do the same with its own compiler.
set -euo pipefail
folder=$1
readonly avr=/usr/share/arduino/hardware/arduino/avr
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Debian's avr-libc does not define DECIMAL_DIG, which the core's strings need.
readonly flags=(-mmcu=atmega2560 -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_AVR_MEGA2560 -DARDUINO_ARCH_AVR
    -DDECIMAL_DIG=9 -Os -ffunction-sections -fdata-sections -I"$avr/cores/arduino" -I"$avr/variants/mega")
for source in "$avr"/cores/arduino/*.c; do
    avr-gcc "${flags[@]}" -std=gnu11 -w -c "$source" -o "$work/${source##*/}.o"
done
for source in "$avr"/cores/arduino/*.cpp; do
    avr-g++ "${flags[@]}" -std=gnu++11 -fno-exceptions -fno-threadsafe-statics -w -c "$source" -o "$work/${source##*/}.o"
done
avr-gcc "${flags[@]}" -std=gnu11 -Wall -Wextra -Werror -c "$folder/src/ohmstrain.c" -o "$work/filter.o"
avr-g++ "${flags[@]}" -std=gnu++11 -fno-exceptions -Wall -Wextra -Werror -I"$folder/src" -include Arduino.h -x c++ \
    -c "$folder/examples/ohmstrain_plotter/ohmstrain_plotter.ino" -o "$work/sketch.o"
avr-g++ -mmcu=atmega2560 -Os -Wl,--gc-sections "$work"/*.o -lm -o "$work/sketch.elf"
avr-size "$work/sketch.elf" | awk 'NR == 2 { print "flash " $1 + $2 " B, RAM " $2 + $3 " B beside the stack" }'
