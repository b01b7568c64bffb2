#!/usr/bin/env bash
# Compiles and runs what `ohmstrain export` writes: C on the host with GCC and Clang, for Cortex-M0+ and -M4F, and there
# under QEMU; the examples for ST's HAL and for Zephyr there, too, against stand-ins for both (neither is installed); the sketches
# against a stand-in for Arduino, and for a Mega 2560 and an Uno with Arduino's core; small
# filters for an ATmega328P under simavr; the Rust module in a no_std crate for Cortex-M4F, and on the host through a recording, as exported C goes through it.
#
#   exported-c.sh [--update]
#
# What each filter costs must be what docs/costs.md says, to a tenth; --update writes that table.
#
# Installs gcc, clang, cmake, gcc-arm-none-eabi, libnewlib-arm-none-eabi, qemu-system-arm, gcc-avr, avr-libc, simavr and arduino-core-avr
# by apt where they are missing and this is root. Prints the largest differences, sizes and instructions per step. Needs a minute.
#
# Environment:
#   OHMSTRAIN  the program; default: built by cargo
set -euo pipefail
cd "$(dirname "$0")/.."
readonly update=${1:-}
[[ $update == --update || $# -eq 0 ]] || { echo "usage: exported-c.sh [--update]" >&2; exit 2; }
readonly here=$PWD/scripts/exported-c
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if ! command -v clang >/dev/null || ! command -v gcc >/dev/null || ! command -v qemu-system-arm >/dev/null ||
    ! command -v cmake >/dev/null || ! command -v avr-gcc >/dev/null || ! command -v simavr >/dev/null || [[ ! -d /usr/share/arduino/hardware/arduino/avr ]] || ! echo '#include <math.h>' | arm-none-eabi-gcc -E - >/dev/null 2>&1; then
    scripts/apt.sh gcc g++ clang cmake make libc6-dev \
        gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm gcc-avr avr-libc simavr arduino-core-avr
fi

ohmstrain=${OHMSTRAIN:-}
if [[ -z $ohmstrain ]]; then
    cargo build --quiet --locked -p ohmstrain-cli
    ohmstrain=$PWD/target/debug/ohmstrain
fi

readonly strict=(-std=c99 -ffp-contract=off -Wall -Wextra -Werror -pedantic -Wdouble-promotion)
readonly m0=(-mcpu=cortex-m0plus -mthumb)
readonly m4f=(-mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard)

say() { printf '%-34s %s\n' "$1" "$2"; }

# report NAME COMMAND...: the first line that a self-test prints; everything, and failure, if it fails.
report() {
    local name=$1
    shift
    if ! "$@" >"$work/output" 2>&1; then
        say "$name" FAILED >&2
        cat "$work/output" >&2
        return 1
    fi
    say "$name" "$(head -n 1 "$work/output")"
}

# QEMU's semihosting console is its standard error.
qemu() {
    timeout 300 qemu-system-arm -M mps2-an386 -icount shift=0 -nographic -monitor none -serial none \
        -semihosting-config enable=on,target=native -kernel "$1" </dev/null
}

# on_host FOLDER COMPILER...: compiles and runs the self-test.
on_host() {
    local folder=$1
    shift
    "$@" "${strict[@]}" -I"$folder/src" \
        "$folder/src/ohmstrain.c" "$folder/selftest/selftest.c" -lm -o "$work/selftest"
    report "${folder##*/}, $*" "$work/selftest"
}

# on_target FOLDER NAME FLAGS...: the same for a microcontroller, and what a step costs there.
on_target() {
    local folder=$1 name=$2 program
    shift 2
    local build=(arm-none-eabi-gcc "$@" -O2 -fno-math-errno -ffunction-sections -I"$folder/src")
    "${build[@]}" "${strict[@]}" -c "$folder/src/ohmstrain.c" -o "$work/filter.o"
    for program in "$folder/selftest/selftest.c" "$here/count.c"; do
        "${build[@]}" -I"$folder/selftest" -std=c99 -ffp-contract=off --specs=nano.specs -nostartfiles \
            -T"$here/mps2.ld" -Wl,--gc-sections "$work/filter.o" "$program" "$here/board.c" -lm -o "$work/program.elf"
        report "${folder##*/}, $name" qemu "$work/program.elf"
    done
    code=$(arm-none-eabi-size "$work/filter.o" | awk 'NR == 2 { print $1 }')
    say "${folder##*/}, $name" "code and constants $code B"
    # shellcheck disable=SC2046  # three words
    costs "$folder" "$name" $(grep -oE 'step: [0-9]+' "$work/output" | grep -oE '[0-9]+') "$code" $(grep -oE 'state [0-9]+|stack [0-9]+' "$work/output" | grep -oE '[0-9]+')
}

# costs FOLDER PROCESSOR INSTRUCTIONS FLASH STATE STACK: a row of docs/costs.md.
costs() {
    local words branches curve
    curve=$(sed -E 's/-[0-9].*//; s/-/ /g' <<<"${1##*/}")
    words=$(sed -nE 's/^ \* (.*)\. On a Cortex-M4F about.*/\1/p' "$1/src/ohmstrain.h")
    branches=$(awk '/^#define OHMSTRAIN_BRANCHES / { print $3 }' "$1/src/ohmstrain.h")
    echo "| $words | $curve | $branches | $2 | $3 | $4 | $5 | $6 |" >>"$work/costs"
}

# near FOLDER WHAT FOUND PROMISED: fails unless what was promised is within a tenth of what was found.
near() {
    awk -v found="$3" -v promised="$4" 'BEGIN { exit !(promised > 0.9 * found && promised < 1.1 * found) }' || {
        echo "$1: $2 are $3, the header says about $4: adjust crates/export/src/cost.rs or hand/constants.rs" >&2
        return 1
    }
}

# promised FOLDER: what the header says of a Cortex-M4F, against what was counted in the last on_target.
promised() {
    local stated counted
    stated=$(tr -d '\n' <"$1/src/ohmstrain.h" | sed 's/ \* / /g' | grep -oE 'about [0-9]+ instructions a step, [0-9]+ B of +code and constants, [0-9]+ B of state and [0-9]+' | grep -oE '[0-9]+')
    counted=$(grep -oE 'step: [0-9]+|state [0-9]+|stack [0-9]+' "$work/output" | grep -oE '[0-9]+')
    set -- "${1##*/}" $stated $counted
    near "$1" "instructions a step" "$6" "$2"
    near "$1" "bytes of code and constants" "$code" "$3"
    near "$1" "bytes of state" "$7" "$4"
    near "$1" "bytes of stack" "$8" "$5"
}

"$ohmstrain" simulate --protocol mixed --speed-mm-s 5 --sample-rate-hz 5 -o "$work/trace.csv"
for kind in polynomial:2:corrected polynomial:0:ekf decaying-exponential:1:sign-split tunnelling:3:hypotheses; do
    IFS=: read -r gauge branches estimator <<<"$kind"
    name=$gauge-$branches-$estimator
    "$ohmstrain" --quiet calibrate "$work/trace.csv" --until 140 --estimator "$estimator" --gauge "$gauge" \
        --branches "$branches" -o "$work/$name.toml"
    if [ "$estimator" = sign-split ]; then
        # As if it had been calibrated on several sessions.
        printf '\n[sessions]\nrest_sd = 0.15\nstart_sd = 0.07\n' >>"$work/$name.toml"
    fi
    folder=$work/$name
    "$ohmstrain" export --sensor "$work/$name.toml" --target c --dt-s 0.2 -o "$folder"
    "$ohmstrain" export --sensor "$work/$name.toml" --target rust --dt-s 0.2 -o "$folder/rust"
    on_host "$folder" gcc -O2
    on_host "$folder" gcc -O1 -fsanitize=address,undefined -fno-sanitize-recover
    on_host "$folder" clang -O2
    on_target "$folder" Cortex-M4F "${m4f[@]}"
    promised "$folder"
    on_target "$folder" Cortex-M0+ "${m0[@]}"
    g++ -std=c++11 -fsyntax-only -Wall -Wextra -Werror -I"$folder/src" -x c++ "$folder/src/ohmstrain.c"
    for sketch in "$folder"/examples/*/*.ino; do
        g++ -std=gnu++11 -fsyntax-only -Wall -Wextra -Werror -I"$here" -include Arduino.h -I"$folder/src" -x c++ "$sketch"
        g++ -std=gnu++11 -fsyntax-only -Wall -Wextra -Werror -DARDUINO_ARCH_ESP32 -I"$here" -include Arduino.h \
            -I"$folder/src" -x c++ "$sketch"
    done
done

# The same sensors on smaller chips.
for kind in polynomial-2-corrected:lean polynomial-2-corrected:instructions=25000 polynomial-2-corrected:flash=36000,ram=3000 tunnelling-3-hypotheses:ram=2600; do
    IFS=: read -r name budget <<<"$kind"
    folder=$work/$name-${budget%%=*}
    "$ohmstrain" export --sensor "$work/$name.toml" --target c --dt-s 0.2 -o "$folder" --budget "$budget" >/dev/null
    "$ohmstrain" export --sensor "$work/$name.toml" --target rust --dt-s 0.2 -o "$folder/rust" --budget "$budget" >/dev/null
    on_host "$folder" gcc -O2
    on_target "$folder" Cortex-M4F "${m4f[@]}"
    promised "$folder"
done
say "polynomial-2-corrected-lean, Mega" "$("$here/arduino-avr.sh" "$work/polynomial-2-corrected-lean" mega)"

# Small filters for an Uno: the self-test there, in simavr, with what `export` promises of it; the sketch with Arduino's core.
for kind in polynomial:0 polynomial:1 polynomial:2 tunnelling:2; do
    IFS=: read -r gauge branches <<<"$kind"
    name=$gauge-$branches-uno
    folder=$work/$name
    "$ohmstrain" --quiet calibrate "$work/trace.csv" --until 140 --estimator ekf --gauge "$gauge" --branches "$branches" -o "$folder.toml"
    "$ohmstrain" export --sensor "$folder.toml" --target c --dt-s 0.2 -o "$folder" --budget board=uno >"$folder.txt"
    on_host "$folder" gcc -O1 -DOHMSTRAIN_LISTED=1 -fsanitize=address,undefined -fno-sanitize-recover
    "$here/uno.sh" "$folder" >"$folder.run"
    while read -r line; do say "$name, simavr" "$line"; done <"$folder.run"
    avr-gcc -mmcu=atmega328p -Os -std=gnu11 -Wall -Wextra -Werror -c "$folder/src/ohmstrain.c" -o "$work/avr.o"
    on_target "$folder" Cortex-M4F "${m4f[@]}"
    promised "$folder"
    on_target "$folder" Cortex-M0+ "${m0[@]}"
    # shellcheck disable=SC2046  # seven words
    set -- $(grep -oE 'step: [0-9]+|state [0-9]+|stack [0-9]+' "$folder.run" | grep -oE '[0-9]+') $(awk -F'|' '/on Arduino Uno/ { print $5, $6, $7, $8 }' "$folder.txt")
    near "$name" "cycles a step" "$1" "$4"
    code=$(avr-size "$work/avr.o" | awk 'NR == 2 { print $1 }')
    costs "$folder" "ATmega328P, cycles" "$1" "$code" "$2" "$3"
    near "$name" "bytes of code and constants" "$code" "$5"
    near "$name" "bytes of state and stack" "$(($2 + $3))" "$6"
    near "$name" "bytes of stack" "$3" "$7"
    "$here/arduino-avr.sh" "$folder" uno >"$work/size"
    while read -r line; do say "$name, Uno" "$line"; done <"$work/size"
    awk -v branches="$branches" -v curve="$gauge" -F'[ :,]+' '{
        kind = $1 == "recorder" ? " | | | " : " | " curve " | " branches " | "
        print "| " $1 kind $3 " | " $6 " |"
    }' "$work/size" >>"$work/sketches"
    awk '{ if ($3 > 24 * 1024) { print "more than 24 KiB of flash: " $0; exit 1 } }' "$work/size" >&2
done

cmake -S "$folder" -B "$work/build" >/dev/null
cmake --build "$work/build" >/dev/null
ctest --test-dir "$work/build" --quiet
say "CMake" "builds, and the self-test passes"

# A hand: a joint of three channels, fused, and one of a single channel.
awk 'BEGIN {
    print "time_s,inner_ohm,middle_ohm,outer_ohm,thumb_ohm,thumb_strain,strain"
    srand(7)
    for (row = 0; row < 900; row++) {
        t = 0.1 * row
        e = 0.15 - 0.10 * cos(0.9 * t) - 0.05 * cos(0.33 * t + 1); rate = 0.09 * sin(0.9 * t) + 0.0165 * sin(0.33 * t + 1)
        thumb = 0.15 - 0.15 * cos(0.7 * t)
        printf "%.1f,%.2f,%.2f,%.2f,%.2f,%.6f,%.6f\n", t, 1000 * exp(2 * e + 0.3 * rate + 0.02 * (rand() - 0.5)),
            2000 * exp(3 * e - 2 * e * e + 0.02 * (rand() - 0.5)), 3000 * exp(1.5 * e + 3 * e * e - 0.2 * rate + 0.02 * (rand() - 0.5)),
            1500 * exp(2.5 * thumb + 0.01 * (rand() - 0.5)), thumb, e
    }
}' >"$work/hand.csv"
"$ohmstrain" --quiet calibrate "$work/hand.csv" -o "$work/hand.toml" --estimator ekf
hand=$work/hand
"$ohmstrain" export --sensor "$work/hand.toml" --target c -o "$hand" >"$work/hand.txt"
for compiler in "gcc -O2" "gcc -O1 -fsanitize=address,undefined -fno-sanitize-recover" "clang -O2"; do
    # shellcheck disable=SC2086  # words
    $compiler "${strict[@]}" -I"$hand/src" "$hand"/src/*.c "$hand/selftest/selftest.c" -lm -o "$work/selftest"
    report "hand, $compiler" "$work/selftest"
done
g++ -std=c++11 -fsyntax-only -Wall -Wextra -Werror -I"$hand/src" -x c++ "$hand/src/ohmstrain.c"
for board in AVR ESP32; do
    g++ -std=gnu++11 -fsyntax-only -Wall -Wextra -Werror "-DARDUINO_ARCH_$board" -I"$here" -include Arduino.h -I"$hand/src" \
        -x c++ "$hand"/examples/*/*.ino
done
gcc -O2 "${strict[@]}" -I"$hand/src" "$hand"/src/*.c "$hand/selftest/replay.c" -lm -o "$work/replay"
"$work/replay" <"$work/hand.csv" >"$work/c.csv"
"$ohmstrain" hand "$work/hand.toml" "$work/hand.csv" >"$work/computer.csv"
# Both in one row: of strain and thumb, value and deviation. The processes of C stand on fewer rows: the fused strain may be off by a part
# of its deviation; the thumb has no fusion.
paste -d, "$work/c.csv" "$work/computer.csv" | awk -F, 'function off(a, b, sd) { return (a > b ? a - b : b - a) / sd } NR > 1 {
    fused = off($2, $9, $10); alone = off($5, $11, $12)
    if (fused > 1) far++
    if (alone > worst) worst = alone
    sum += fused
    rows++
} END {
    printf "%d rows as the computer has them: fused %.2g deviations off on average, alone %.1e at most\n", rows, sum / rows, worst
    exit !(rows == 900 && sum / rows < 0.2 && far < 0.02 * rows && worst < 0.01)
}' >"$work/output" || { cat "$work/output" >&2; exit 1; }
say "hand, replay" "$(cat "$work/output")"
build=(arm-none-eabi-gcc "${m4f[@]}" -O2 -fno-math-errno -ffunction-sections -I"$hand/src" "${strict[@]}")
mkdir "$work/objects"
for source in "$hand"/src/*.c; do
    "${build[@]}" -c "$source" -o "$work/objects/$(basename "$source" .c).o"
done
for program in "$hand/selftest/selftest.c" "$here/hand_count.c"; do
    arm-none-eabi-gcc "${m4f[@]}" -O2 -I"$hand/src" -I"$hand/selftest" -std=c99 --specs=nano.specs -nostartfiles -T"$here/mps2.ld" \
        -Wl,--gc-sections "$work"/objects/*.o "$program" "$here/board.c" -lm -o "$work/program.elf"
    report "hand, Cortex-M4F" qemu "$work/program.elf"
done
code=$(arm-none-eabi-size "$work"/objects/*.o | awk 'NR > 1 { sum += $1 } END { print sum }')
# shellcheck disable=SC2046  # six words
set -- $(grep -oE 'step: [0-9]+|state [0-9]+|stack [0-9]+' "$work/output" | grep -oE '[0-9]+') $(grep '^all' "$work/hand.txt" | grep -oE '[0-9]+ (i|B)' | grep -oE '[0-9]+')
near hand "instructions a step" "$1" "$4"
near hand "bytes of code and constants" "$code" "$5"
near hand "bytes of state" "$2" "$6"

# The Rust modules, all in one crate: without std for Cortex-M4F, and on the host through a recording, as exported C goes through it.
mkdir -p "$work/crate/src/bin"
cat >"$work/crate/Cargo.toml" <<TOML
[workspace]
[package]
name = "exported"
version = "0.0.0"
edition = "2024"
[dependencies]
ohmstrain-ekf = { path = "$PWD/crates/ekf", default-features = false }
ohmstrain-model = { path = "$PWD/crates/model" }
[target.'cfg(target_os = "none")'.dependencies]
cortex-m = "0.7"
cortex-m-rt = "0.7"
cortex-m-semihosting = "0.5"
[profile.release]
lto = "fat"
codegen-units = 1
panic = "abort"
TOML
cp embedded/firmware/memory.x "$work/crate"
cat >"$work/crate/build.rs" <<RS
fn main() {
    println!("cargo:rustc-link-search={}", std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default());
    println!("cargo:rustc-link-arg-bin=counted=-Tlink.x");
}
RS
echo '#![no_std]' >"$work/crate/src/lib.rs"
modules=()
for module in "$work"/*/rust/sensor.rs; do
    folder=${module%/rust/sensor.rs}
    name=$(tr - _ <<<"${folder##*/}")
    modules+=("$folder:$name")
    cp "$module" "$work/crate/src/$name.rs"
    echo "pub mod $name;" >>"$work/crate/src/lib.rs"
done
echo "pub use polynomial_2_corrected as counted;" >>"$work/crate/src/lib.rs"
cp "$here/counted.rs" "$work/crate/src/bin"
# Reading, its deviation, strain and its deviation, until the sensor rests.
awk '/REZEROED = / { rezeroed = $5 } /^    [{]/ && rows++ < rezeroed { gsub(/[{}f,]/, " "); print $1, $2, $3, $4 }' \
    "$work/polynomial-2-corrected/selftest/vectors.h" >"$work/vectors"
awk '{ sub("NAN", "f32::NAN"); rows = rows "(" $1 ", " $2 "), " } END { print "&[" rows "]" }' "$work/vectors" \
    >"$work/crate/src/bin/readings.rs"
cp Cargo.lock "$work/crate/Cargo.lock"
readonly scripts=$PWD/scripts target=$PWD/target
(cd "$work/crate" && RUSTFLAGS="-D warnings" BARE_METAL_TARGET_DIR="$target/exported" "$scripts/bare-metal.sh" --release --lib --bin counted)
say "Rust modules" "compile without std for Cortex-M4F"
elf=$target/exported/thumbv7em-none-eabihf/release/counted
qemu "$elf" >"$work/counted.out"
if arm-none-eabi-nm "$elf" | grep -E ' __aeabi_(d|cd|f2d|ui2d|i2d)|panicking'; then
    echo "the Rust filter for Cortex-M4F contains double precision in software, or a panic" >&2
    exit 1
fi
# As the self-test has it, but for how numbers of a step and exponentials are rounded.
od -An -v -tf4 -w4 -j12 "$work/counted.out" | paste -d' ' "$work/vectors" - | awk '{
    off = ($3 - $5) / $4; if (off < 0) off = -off
    if (off > worst) worst = off
} END { exit !(NR > 100 && worst < 0.01) }' || {
    echo "the Rust filter on Cortex-M4F is not as the self-test has it" >&2
    exit 1
}
# shellcheck disable=SC2046  # three words
set -- $(od -An -v -tu4 -N12 "$work/counted.out")
rust="In Rust the first of these filters takes $(($2 / $1)) instructions a step on a Cortex-M4F, $3 B of RAM beside the stack, and $(arm-none-eabi-size "$elf" | awk 'NR == 2 { print $1 }') B of flash with the rest of the program."
say "polynomial_2_corrected, Rust" "$(($2 / $1)) instructions a step on Cortex-M4F, $3 B of RAM beside the stack, no panic in $(arm-none-eabi-size "$elf" | awk 'NR == 2 { print $1 }') B of the whole program"

cp "$here/replayed.rs" "$work/crate/src/bin/replayed.rs"
{
    echo 'fn main() -> Result<(), Box<dyn Error>> {'
    echo '    match std::env::args().nth(1).as_deref() {'
    for module in "${modules[@]}"; do
        name=${module#*:}
        echo "        Some(\"$name\") => replay(exported::$name::filter()?, exported::$name::DT_S),"
    done
    echo '        other => Err(format!("no module {other:?}").into()),'
    echo '    }'
    echo '}'
} >"$work/crate/src/bin/modules.rs"
(cd "$work/crate" && cargo build --quiet --release --target-dir "$target/exported-host" --bin replayed)
# Spikes, an unplugging, a pause and another day.
awk -F, -v OFS=, '/^[0-9]/ {
    row++
    if (row % 97 == 0) $2 *= 1.5
    if (row >= 200 && row < 210) $2 = 210000
    if (row >= 300 && row < 320) $2 = ""
    if (row >= 420) $2 *= 1.35
} 1' "$work/trace.csv" >"$work/faulty.csv"
# One rounding of single precision more in every reading.
awk -F, -v OFS=, '/^[0-9]/ && $2 != "" { $2 = sprintf("%.9g", $2 * (1 + 1.2e-7)) } 1' "$work/faulty.csv" >"$work/rounded.csv"

# apart FILE FILE: rows of two replays; how far strain or deviation are apart, in deviations, on average and at most; rows of other flags.
apart() {
    paste -d, "$1" "$2" | awk -F, 'NR > 1 {
        off = ($2 - $6) / $3; if (off < 0) off = -off
        wider = $3 / $7 - 1; if (wider < 0) wider = -wider
        off = off > wider ? off : wider
        if (off > worst) worst = off
        if ($4 != $8) flags++
        sum += off
        rows++
    } END { printf "%d %.1e %.1e %d\n", rows, sum / rows, worst, flags }'
}

for module in "${modules[@]}"; do
    folder=${module%:*} name=${module#*:}
    gcc -O2 "${strict[@]}" -I"$folder/src" "$folder/src/ohmstrain.c" "$folder/selftest/replay.c" -lm -o "$work/replay"
    "$work/replay" <"$work/faulty.csv" >"$work/c.csv"
    "$target/exported-host/release/replayed" "$name" <"$work/faulty.csv" >"$work/rust.csv"
    # Exponentials, sums and the numbers of a step are rounded otherwise. Where hypotheses amplify that, on another day most, C is
    # as far from itself with readings one rounding larger: Rust may be three times as far.
    "$work/replay" <"$work/rounded.csv" >"$work/again.csv"
    read -r rows mean worst flags < <(apart "$work/c.csv" "$work/rust.csv")
    read -r _ own_mean own_worst own_flags < <(apart "$work/c.csv" "$work/again.csv")
    say "$name, Rust" "$rows rows as exported C: $mean deviations off, $worst at most; C itself $own_mean, $own_worst"
    awk -v rows="$rows" -v mean="$mean" -v worst="$worst" -v flags="$flags" -v own_mean="$own_mean" -v own_worst="$own_worst" \
        -v own_flags="$own_flags" 'function most(least, own) { return least > 3 * own ? least : 3 * own }
        BEGIN { exit !(rows > 500 && mean < most(1e-3, own_mean) && worst < most(0.1, own_worst) && flags <= 3 * own_flags) }'
done

# The examples for ST's HAL and for Zephyr on a Cortex-M4F in QEMU, with stand-ins for both: a converter that replays that recording as
# codes, some of whose conversions fail or come late. What they print must be what the replay on the host finds in the same readings.

# examples FOLDER
examples() {
    local folder=$1 name=${1##*/} example=$1/examples/stm32_hal found
    local build=("${m4f[@]}" -O2 -fno-math-errno -ffunction-sections)
    local link=(--specs=nano.specs -nostartfiles "-T$here/mps2.ld" -Wl,--gc-sections)
    # Ten kiloohms in series; products with codes of 12 bits are exact in single precision, and so readings have the same bits here and there.
    awk -F, -v codes="$work/replayed_codes.h" -v readings="$work/readings.csv" 'BEGIN {
        print "time_s,resistance_ohm,reading_sd" >readings
        print "static const short CODES[] = {" >codes
    } /^[0-9]/ {
        code = $2 == "" ? -1 : int(4095 * $2 / ($2 + 10000) + 0.5)
        if (++row % 61 == 0) code = -2
        print code "," >codes
        ohm = 10000 * code / (4095 - code)
        if (code == -1) printf "%.9g,,\n", $1 >readings
        if (code >= 0) printf "%.9g,%.17g,%.9g\n", $1, ohm, 0.29 * (ohm + 10000) * (ohm + 10000) / (10000 * 4095) >readings
    } END { print "};" >codes }' "$work/faulty.csv"
    gcc -O2 "${strict[@]}" -I"$folder/src" "$folder/src/ohmstrain.c" "$folder/selftest/replay.c" -lm -o "$work/replay"
    "$work/replay" <"$work/readings.csv" >"$work/host.csv"

    arm-none-eabi-gcc "${build[@]}" "${strict[@]}" -I"$here/stm32" -I"$folder/src" -c "$example/ohmstrain_app.c" -o "$work/app.o"
    arm-none-eabi-gcc "${build[@]}" -std=c99 -ffp-contract=off -Wall -Wextra -Werror -I"$here/stm32" -I"$here" -I"$work" -I"$folder/src" \
        -I"$example" "${link[@]}" "$work/app.o" "$folder/src/ohmstrain.c" "$here/stm32/board.c" "$here/stm32/hal.c" "$here/board.c" -lm -o "$work/hal.elf"
    qemu "$work/hal.elf" >"$work/hal.csv" 2>&1
    found=$(as_replayed "$work/hal.csv")
    say "$name, STM32 HAL example" "stand-in for the HAL, Cortex-M4F: $found"

    rm -rf "$work/zephyr"
    cmake -S "$folder/examples/zephyr" -B "$work/zephyr" -DZephyr_DIR="$here/zephyr" -DCMAKE_SYSTEM_NAME=Generic \
        -DCMAKE_TRY_COMPILE_TARGET_TYPE=STATIC_LIBRARY -DCMAKE_C_COMPILER=arm-none-eabi-gcc \
        -DCMAKE_C_FLAGS="${build[*]} -std=c99 -Wall -Wextra -Werror" -DCMAKE_EXE_LINKER_FLAGS="${link[*]}" \
        -DSTAND_IN_SOURCES="$here/zephyr/board.c;$here/board.c" -DSTAND_IN_INCLUDES="$here;$work" >"$work/output" 2>&1 &&
        cmake --build "$work/zephyr" >>"$work/output" 2>&1 || {
        cat "$work/output" >&2
        return 1
    }
    qemu "$work/zephyr/zephyr.elf" >"$work/zephyr.csv" 2>&1
    found=$(as_replayed "$work/zephyr.csv")
    say "$name, Zephyr module and example" "stand-in for Zephyr, Cortex-M4F: $found"
}

# as_replayed FILE: fails unless lines of an example are those of the replay on the host, to one unit of the last decimal.
as_replayed() {
    tr -d '\r' <"$1" | paste -d, "$work/host.csv" - | awk -F, '
        function apart(a, b) { return a > b ? a - b : b - a }
        NR > 1 {
            rows++
            if (apart(1000 * $1, $5) > 1 || !(apart($2, $6) < 1.1e-5 && apart($3, $7) < 1.1e-5) || $4 != $8 || NF != 8) {
                print "line " NR ": " $0 >"/dev/stderr"
                exit 1
            }
            seen[$4]++
        } END {
            for (flags in seen) kinds++
            if (!(rows > 500 && kinds > 3)) exit 1
            print rows " lines as the replay on the host, with " kinds " kinds of flags"
        }' || {
        echo "$1 is not as the replay has it" >&2
        return 1
    }
}

for name in polynomial-0-ekf polynomial-2-corrected; do
    examples "$work/$name"
done
if python3 -c 'import yaml' 2>/dev/null; then
    python3 -c 'import sys, yaml; assert yaml.safe_load(open(sys.argv[1]))["build"] == {"cmake": "zephyr", "kconfig": "zephyr/Kconfig"}' \
        "$work/polynomial-0-ekf/zephyr/module.yml"
fi

{
    cat <<'MD'
# What exported filters cost

Generated by `scripts/exported-c.sh --update`; do not edit. The sensors are calibrated on 140 s of a simulated recording; instructions are means over the motion of the self-test,
counted in QEMU (`arm-none-eabi-gcc -O2 -fno-math-errno`). Cycles are more than instructions; none have been measured on a Cortex-M board. On the ATmega328P simavr counts
cycles (`avr-gcc -Os`; stack with `-flto`). Flash is code and constants of the filter, without the C library; the stack is that of a step.

| filter | curve | branches | processor | instructions a step | flash, B | state, B | stack, B |
|---|---|---|---|---|---|---|---|
MD
    awk '!printed[$0]++' "$work/costs"
    printf '\n%s\n\n' "$rust"
    cat <<'MD'
Sketches of an exported folder on an Arduino Uno, the plotter with an extended Kalman filter, linked with Arduino's core and its flags:

| sketch | curve | branches | flash, B | RAM beside the stack, B |
|---|---|---|---|---|
MD
    awk '!printed[$0]++' "$work/sketches"
} >"$work/costs.md"
if [[ $update == --update ]]; then
    cp "$work/costs.md" docs/costs.md
fi
# The same rows, and numbers that are no further than a tenth.
paste -d'\n' docs/costs.md "$work/costs.md" | awk '
    function numbers(line, all) { gsub(/[^0-9. ]/, " ", line); gsub(/\. /, " ", line); return split(line, all, " ") }
    function words(line) { gsub(/[0-9]/, "", line); return line }
    NR % 2 { stated = $0; next }
    {
        n = numbers(stated, a); m = numbers($0, b)
        if (n != m || words(stated) != words($0)) { bad = 1 }
        for (k = 1; k <= n; k++) { if (b[k] + 0 > 1.1 * a[k] || b[k] + 0 < 0.9 * a[k]) { bad = 1 } }
        if (bad) { print "docs/costs.md says " stated ", found " $0 ": run with --update"; exit 1 }
    }' >&2
