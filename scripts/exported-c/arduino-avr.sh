#!/usr/bin/env bash
# Compiles and links the sketch of an exported folder with Arduino's own core and its flags, -flto included, for a Mega 2560 or an Uno;
# prints what it takes.
#
#   arduino-avr.sh FOLDER mega|uno
#
# Needs Debian's gcc-avr, avr-libc and arduino-core-avr. arduino-cli would do the same with its own compiler.
set -euo pipefail
folder=$1
readonly avr=/usr/share/arduino/hardware/arduino/avr
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

case $2 in
mega) board=(-mmcu=atmega2560 -DARDUINO_AVR_MEGA2560 -I"$avr/variants/mega") ;;
uno) board=(-mmcu=atmega328p -DARDUINO_AVR_UNO -I"$avr/variants/standard") ;;
*) echo "arduino-avr.sh: expected mega or uno, found $2" >&2 && exit 2 ;;
esac
# As platform.txt has them. Debian's avr-libc does not define DECIMAL_DIG, which the core's strings need.
readonly flags=("${board[@]}" -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_ARCH_AVR -DDECIMAL_DIG=9 -Os -flto -ffunction-sections
    -fdata-sections -I"$avr/cores/arduino")
readonly cpp=(-std=gnu++11 -fpermissive -fno-exceptions -fno-threadsafe-statics)
mkdir "$work/core"
for source in "$avr"/cores/arduino/*.{c,S}; do
    avr-gcc "${flags[@]}" -w -c "$source" -o "$work/core/${source##*/}.o"
done
for source in "$avr"/cores/arduino/*.cpp; do
    avr-g++ "${flags[@]}" "${cpp[@]}" -w -c "$source" -o "$work/core/${source##*/}.o"
done
avr-gcc-ar rcs "$work/core.a" "$work"/core/*.o
avr-gcc "${flags[@]}" -std=gnu11 -Wall -Wextra -Werror -c "$folder/src/ohmstrain.c" -o "$work/filter.o"
for sketch in "$folder"/examples/*/*.ino; do
    avr-g++ "${flags[@]}" "${cpp[@]}" -Wall -Wextra -Werror -I"$folder/src" -include Arduino.h -x c++ -c "$sketch" -o "$work/sketch.o"
    avr-gcc "${flags[@]}" -fuse-linker-plugin -Wl,--gc-sections "$work/sketch.o" "$work/filter.o" "$work/core.a" -lm -o "$work/sketch.elf"
    avr-size "$work/sketch.elf" |
        awk -v sketch="$(basename "$sketch" .ino)" 'NR == 2 { print sketch ": flash " $1 + $2 " B, RAM " $2 + $3 " B beside the stack" }'
done
