#!/usr/bin/env bash
# Makes what a release consists of, in dist/release, and tries each part in a clean place on a recording.
#
#   release.sh                every part
#   release.sh PART...        archive  the program with man pages and completions (dist.sh)
#                             deb      the same as a Debian package
#                             wheel    the Python package, which brings the program, for glibc 2.17 and for musl
#                             npm      the package for browsers and Node, and the page (web.sh)
#                             c        the library for programs in C, static and shared, which reads a sensor when it runs; and an
#                                      exported filter of a simulated sensor as an Arduino library
#                             crates   a .crate file for each crate, each built from what is in it
#                             check    licences and advisories of dependencies (deny.toml), public names against the last release's tag,
#                                      and whether the program compiles with the oldest Rust, for Windows and for macOS
#
# Prints the size of each, the oldest glibc that will do, and how long the job took that it was tried on.
#
# Environment:
#   TARGET  the program's target, one that runs here. Default: on Linux the processor's *-unknown-linux-musl, if rustup has it: a
#           program that needs no library at all. Else the machine's own.
set -euo pipefail
cd "$(dirname "$0")/.."
readonly out=$PWD/dist/release tools=${CARGO_TARGET_DIR:-$PWD/target}/release-tools host=$(rustc -vV | sed -n 's/^host: //p')
readonly version=$(sed -n '/^\[workspace.package\]/,/^version/s/^version = "\(.*\)"/\1/p' Cargo.toml)

die() {
    printf 'release: %s\n' "$*" >&2
    exit 1
}

has_target() {
    timeout 120 rustup target add "$1" >/dev/null 2>&1
}

target() {
    local static=${host%%-*}-unknown-linux-musl
    if [[ -z ${TARGET:-} && $host == *-linux-gnu ]] && has_target "$static"; then
        echo "$static"
    else
        echo "${TARGET:-$host}"
    fi
}

# Zig, which brings the headers of other C libraries, and what drives it; from PyPI.
tools() {
    [[ -x $tools/bin/python ]] || "${PYTHON3:-python3}" -m venv "$tools"
    "$tools/bin/python" -m pip install --quiet 'cargo-zigbuild>=0.20' 'ziglang>=0.13' 'maturin>=1.9,<2' 'wheel>=0.45'
}

# The folder with the program, man pages and completions, made once a run.
has_program=
program() {
    [[ -z $has_program ]] || return 0
    has_program=yes
    if [[ $target == *-musl ]]; then
        tools
        PATH=$tools/bin:$PATH BUILD=zigbuild scripts/dist.sh --target "$target" >/dev/null
    else
        scripts/dist.sh --target "$target" >/dev/null
    fi
}

# The oldest glibc that has what a program asks for.
glibc() {
    objdump -T "$1" 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1 | sed 's/_/ /' | grep . || echo "no glibc"
}

# made FILE WHAT-IT-NEEDS SECONDS
made() {
    printf '%-58s %9d bytes, %s%s\n' "$(basename "$1")" "$(wc -c <"$1")" "${2:-any system}" "${3:+, tried in $3 s}"
}

# Makes a recording, calibrates on it and filters it with a program; prints the seconds that took.
try_program() {
    local clean start=$SECONDS
    clean=$(mktemp -d)
    (
        cd "$clean"
        "$1" -q example -o trace.csv
        "$1" -q calibrate trace.csv --until 200 -o sensor.toml
        "$1" -q filter trace.csv --sensor sensor.toml -o strain.csv
        [[ $(timeout 2 "$1" -q serve --port 0 || true) == http://127.0.0.1:* ]] || die "$1 has no page"
        [[ $(wc -l <strain.csv) -gt 8000 ]] || die "$1 filtered nothing"
    )
    rm -rf "$clean"
    echo $((SECONDS - start))
}

archive() {
    program
    cp "$folder.tar.gz" "$out"
    local clean seconds
    clean=$(mktemp -d)
    tar -C "$clean" -xzf "$out/$(basename "$folder").tar.gz"
    seconds=$(try_program "$clean/$(basename "$folder")/ohmstrain")
    if [[ $target == *-musl && $EUID -eq 0 ]]; then
        # Where there is nothing else: no shell, no library, no folder for temporary files.
        (cd "$clean" && chroot . "/$(basename "$folder")/ohmstrain" -q example -o /trace.csv)
    fi
    rm -rf "$clean"
    made "$out/$(basename "$folder").tar.gz" "$(glibc "$folder/ohmstrain")" "$seconds"
}

deb() {
    program
    local root floor package seconds
    root=$(mktemp -d)
    floor=$(glibc "$folder/ohmstrain")
    install -Dm755 "$folder/ohmstrain" "$root/usr/bin/ohmstrain"
    install -Dm644 -t "$root/usr/share/man/man1" "$folder"/man/*.1
    gzip -9n "$root"/usr/share/man/man1/*.1
    install -Dm644 "$folder/completions/ohmstrain.bash" "$root/usr/share/bash-completion/completions/ohmstrain"
    install -Dm644 -t "$root/usr/share/zsh/vendor-completions" "$folder/completions/_ohmstrain"
    install -Dm644 -t "$root/usr/share/fish/vendor_completions.d" "$folder/completions/ohmstrain.fish"
    install -Dm644 -t "$root/usr/share/doc/ohmstrain" LICENSE-MIT LICENSE-APACHE README.md
    install -d "$root/DEBIAN"
    cat >"$root/DEBIAN/control" <<EOF
Package: ohmstrain
Version: $version
Architecture: $(dpkg --print-architecture)
Maintainer: The ohmstrain authors <https://github.com/ohmstrain/ohmstrain>
Section: science
Priority: optional
$([[ $floor == no* ]] || echo "Depends: libc6 (>= ${floor#GLIBC }), libgcc-s1")
Homepage: https://github.com/ohmstrain/ohmstrain
Description: strain from the resistance of soft sensors, with an error bar
 Calibrates a soft, stretchable strain sensor from recordings, filters and smooths its readings, and exports the
 calibrated filter as C or Rust for a microcontroller.
EOF
    sed -i '/^$/d' "$root/DEBIAN/control"
    package=$out/ohmstrain_${version}_$(dpkg --print-architecture).deb
    dpkg-deb --root-owner-group -Zxz --build "$root" "$package" >/dev/null
    rm -rf "$root"
    root=$(mktemp -d)
    dpkg-deb --extract "$package" "$root"
    seconds=$(try_program "$root/usr/bin/ohmstrain")
    rm -rf "$root"
    made "$package" "$floor" "$seconds"
}

# A wheel for each C library of Linux, linked by zig, with the program among its scripts; on other systems one for the machine.
wheel() {
    program
    tools
    local python=$tools/bin/python wheels seconds clean
    wheels=$(mktemp -d)
    rm -f "$out"/ohmstrain-*.whl
    if [[ $host == *-linux-gnu ]]; then
        build_wheel --zig --target "$host" --compatibility manylinux_2_17
        if has_target "${host/gnu/musl}"; then
            build_wheel --zig --target "${host/gnu/musl}" --compatibility musllinux_1_2
        else
            echo "NOT MADE: the wheel for musl, since rustup has no ${host/gnu/musl} here" >&2
        fi
    else
        build_wheel
    fi
    rm -rf "$wheels"
    clean=$(mktemp -d)
    "${PYTHON3:-python3}" -m venv "$clean"
    # Of this machine's wheels pip takes the one that suits.
    "$clean/bin/python" -m pip install --quiet --find-links "$out" "ohmstrain==$version"
    seconds=$(try_program "$clean/bin/ohmstrain")
    "$clean/bin/python" -c 'import ohmstrain'
    rm -rf "$clean"
    local file
    for file in "$out"/ohmstrain-*.whl; do
        # Nothing here runs what is for musl's Python.
        [[ $file != *musllinux* ]] || seconds=
        made "$file" "program: $(glibc "$folder/ohmstrain")" "$seconds"
    done
}

# build_wheel FLAG OF maturin...
build_wheel() {
    local made work
    (cd crates/python && PATH=$tools/bin:$PATH "$python" -m maturin build --quiet --release --locked --out "$wheels" "$@" >&2)
    made=$(echo "$wheels"/*.whl)
    work=$(mktemp -d)
    "$python" -m wheel unpack --dest "$work" "$made" >/dev/null
    install -Dm755 -t "$work/ohmstrain-$version/ohmstrain-$version.data/scripts" "$folder/ohmstrain"
    "$python" -m wheel pack --dest-dir "$out" "$work/ohmstrain-$version" >/dev/null
    rm -rf "$work" "$made"
}

npm() {
    scripts/web.sh --package "$out"
    cp web/dist/index.html "$out/ohmstrain-page.html"
    made "$(echo "$out"/ohmstrain-*.tgz)" "Node 20 or a browser"
    made "$out/ohmstrain-page.html" "a browser"
}

# The library for programs in C, linked by zig on Linux so that it runs with glibc 2.17.
library() {
    local packed name=ohmstrain-c-$version-$host built=${CARGO_TARGET_DIR:-target}/release clean file start
    if [[ $host == *-linux-gnu ]]; then
        tools
        PATH=$tools/bin:$PATH cargo-zigbuild build --quiet --locked --release -p ohmstrain-c --target "$host.2.17"
        built=${CARGO_TARGET_DIR:-target}/$host/release
    else
        cargo build --quiet --locked --release -p ohmstrain-c
    fi
    packed=$(mktemp -d)
    mkdir -p "$packed/$name/lib"
    cp -rL crates/c/include crates/c/examples crates/c/README.md LICENSE-MIT LICENSE-APACHE "$packed/$name"
    for file in "$built"/libohmstrain_c.{a,so,dylib}; do
        [[ ! -e $file ]] || cp "$file" "$packed/$name/lib"
    done
    [[ -e $packed/$name/lib/libohmstrain_c.a ]] || die "no library for C in $built"
    tar -C "$packed" -czf "$out/$name.tar.gz" "$name"
    clean=$(mktemp -d)
    tar -C "$clean" -xzf "$out/$name.tar.gz"
    start=$SECONDS
    (
        cd "$clean/$name/examples"
        "${CC:-cc}" -std=c99 -O2 filter.c -I../include ../lib/libohmstrain_c.a -lm -lpthread -ldl -o filter
        printf 'time_s,resistance_ohm\n0.00,1600\n0.05,1632\n0.10,1680\n' >readings.csv
        ./filter sensor.toml readings.csv >strain.csv
        [[ $(wc -l <strain.csv) -eq 4 ]] || die "the library for C filtered nothing"
        "${CC:-cc}" -std=c99 -O2 filter.c -I../include -L../lib -lohmstrain_c -lm -Wl,-rpath,"$PWD/../lib" -o shared
        ./shared sensor.toml readings.csv | cmp - strain.csv || die "the shared library filters otherwise than the static one"
    )
    made "$out/$name.tar.gz" "$(glibc "$(echo "$packed/$name/lib"/*.so)"), a C99 compiler" $((SECONDS - start))
    rm -rf "$clean" "$packed"
}

# The library, and the example sensor's filter: an Arduino library, and C that any compiler takes.
c() {
    library
    program
    local clean file=$out/ohmstrain-arduino-$version.zip start
    clean=$(mktemp -d)
    "$folder/ohmstrain" -q export --sensor crates/ohmstrain/examples/sensor.toml --target c --dt-s 0.05 -o "$clean/ohmstrain" >/dev/null
    rm -f "$file"
    (cd "$clean" && python3 -m zipfile -c "$file" ohmstrain)
    rm -rf "$clean"
    clean=$(mktemp -d)
    python3 -m zipfile -e "$file" "$clean"
    start=$SECONDS
    # As its README says.
    (cd "$clean/ohmstrain" && cc -std=c99 -O2 -ffp-contract=off -Isrc src/ohmstrain.c selftest/selftest.c -lm -o selftest/run &&
        selftest/run) >/dev/null
    rm -rf "$clean"
    made "$file" "a C99 compiler" $((SECONDS - start))
}

crates() {
    cargo package --quiet --locked --workspace --exclude ohmstrain-tests
    local crate clean name
    clean=$(mktemp -d)
    printf '[workspace]\nmembers = ["*"]\nresolver = "3"\n[patch.crates-io]\n' >"$clean/Cargo.toml"
    for crate in "${CARGO_TARGET_DIR:-target}"/package/*-"$version".crate; do
        cp "$crate" "$out"
        made "$crate"
        tar -C "$clean" -xzf "$crate"
        name=$(basename "$crate" ".crate")
        echo "${name%-"$version"} = { path = \"$name\" }" >>"$clean/Cargo.toml"
    done
    # Tests and examples, too, need nothing but what is in the packages.
    cp Cargo.lock "$clean"
    (cd "$clean" && CARGO_TARGET_DIR=$tools/packages cargo check --quiet --workspace --all-targets)
    echo "tests and examples of the crates compile from what is in them"
    rm -rf "$clean"
}

# Licences and sources of dependencies, and advisories where their list can be had; then compiles, without linking, with the
# oldest Rust and for systems that nothing here runs on.
check() {
    cargo install --quiet --locked --root "$tools/cargo" --version '^0.20' cargo-deny
    "$tools/cargo/bin/cargo-deny" --log-level error check licenses bans sources
    if timeout 20 git ls-remote https://github.com/RustSec/advisory-db HEAD >/dev/null 2>&1; then
        "$tools/cargo/bin/cargo-deny" --log-level error check advisories
    else
        echo "NOT CHECKED: advisories, since their list cannot be had here" >&2
    fi
    local minimum system tag
    tag=$(git tag --list 'v*' --sort=-version:refname | head -n 1)
    if [[ -n $tag ]]; then
        cargo install --quiet --locked --root "$tools/cargo" --version '>=0.45, <1' cargo-semver-checks
        "$tools/cargo/bin/cargo-semver-checks" semver-checks --workspace --exclude ohmstrain-tests --baseline-rev "$tag"
    else
        echo "NOT CHECKED: public names against the last release, since no tag is called v*" >&2
    fi
    minimum=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    if timeout 300 rustup toolchain install "$minimum" --profile minimal >/dev/null 2>&1; then
        cargo "+$minimum" check --quiet --locked -p ohmstrain-cli -p ohmstrain-c --target-dir "$tools/minimum"
        echo "Rust $minimum: compiles"
    else
        echo "NOT CHECKED: Rust $minimum, since rustup does not have it here" >&2
    fi
    tools
    for system in x86_64-pc-windows-gnu aarch64-apple-darwin; do
        if has_target "$system"; then
            PATH=$tools/bin:$PATH cargo-zigbuild check --quiet --locked -p ohmstrain-cli -p ohmstrain-c --target "$system"
            echo "$system: compiles"
        else
            echo "NOT CHECKED: $system, since rustup does not have it here" >&2
        fi
    done
}

readonly all="archive deb wheel npm c crates check"
parts=("$@")
((${#parts[@]})) || read -ra parts <<<"$all"
for part in "${parts[@]}"; do
    [[ " $all " == *" $part "* ]] || die "expected one of $all, found $part"
done
[[ -e tests/released/$version ]] || die "no tests/released/$version: run scripts/released.sh"
target=$(target)
readonly target folder=$PWD/dist/ohmstrain-$version-$target
mkdir -p "$out"
for part in "${parts[@]}"; do
    "$part"
done
