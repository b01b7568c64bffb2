#!/usr/bin/env bash
# Makes what a release consists of, in dist/release, and tries each part in a clean place on a recording.
#
#   release.sh                every part
#   release.sh PART...        archive  the program with man pages and completions (dist.sh)
#                             deb      the same as a Debian package
#                             wheel    the Python package, which brings the program
#                             npm      the package for browsers and Node, and the page (web.sh)
#                             crates   a .crate file for each crate, each built from what is in it
#
# Prints size and, of programs, the oldest glibc that will do: that of the machine that built them at most.
#
# Environment:
#   TARGET  another target of Rust's for archive and deb, one that runs here: x86_64-unknown-linux-musl needs no glibc
set -euo pipefail
cd "$(dirname "$0")/.."
readonly out=$PWD/dist/release target=${TARGET:-$(rustc -vV | sed -n 's/^host: //p')}
readonly version=$(sed -n '/^\[workspace.package\]/,/^version/s/^version = "\(.*\)"/\1/p' Cargo.toml)
readonly folder=$PWD/dist/ohmstrain-$version-$target

die() {
    printf 'release: %s\n' "$*" >&2
    exit 1
}

# The oldest glibc that has what a program asks for.
glibc() {
    objdump -T "$1" 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1 | sed 's/_/ /' | grep . || echo "no glibc"
}

made() {
    printf '%-60s %10d bytes, %s\n' "$(basename "$1")" "$(wc -c <"$1")" "${2:-any system}"
}

# Makes a recording, calibrates on it and filters it with a program.
try_program() {
    local clean
    clean=$(mktemp -d)
    (
        cd "$clean"
        "$1" -q simulate --protocol mixed --speed-mm-s 5 --sample-rate-hz 5 --mismatched -o trace.csv
        "$1" -q calibrate trace.csv --estimator ekf -o sensor.toml
        "$1" -q filter trace.csv --sensor sensor.toml -o strain.csv
        [[ $(wc -l <strain.csv) -gt 2000 ]] || die "$1 filtered nothing"
    )
    rm -rf "$clean"
}

archive() {
    TARGET= scripts/dist.sh --target "$target" >/dev/null
    cp "$folder.tar.gz" "$out"
    local clean
    clean=$(mktemp -d)
    tar -C "$clean" -xzf "$out/$(basename "$folder").tar.gz"
    try_program "$clean/$(basename "$folder")/ohmstrain"
    rm -rf "$clean"
    made "$out/$(basename "$folder").tar.gz" "$(glibc "$folder/ohmstrain")"
}

deb() {
    [[ -x $folder/ohmstrain ]] || scripts/dist.sh --target "$target" >/dev/null
    local root floor package
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
    try_program "$root/usr/bin/ohmstrain"
    rm -rf "$root"
    made "$package" "$floor"
}

# The wheel of scripts/python.sh with the program among its scripts.
wheel() {
    [[ -x $folder/ohmstrain ]] || scripts/dist.sh --target "$target" >/dev/null
    local python work clean
    python=$(scripts/python.sh)
    "$python" -m pip install --quiet 'wheel>=0.45'
    work=$(mktemp -d)
    "$python" -m wheel unpack --dest "$work" target/python/wheels/ohmstrain-*.whl >/dev/null
    install -Dm755 -t "$work/ohmstrain-$version/ohmstrain-$version.data/scripts" "$folder/ohmstrain"
    rm -f "$out"/ohmstrain-*.whl
    "$python" -m wheel pack --dest-dir "$out" "$work/ohmstrain-$version" >/dev/null
    rm -rf "$work"
    clean=$(mktemp -d)
    "${PYTHON3:-python3}" -m venv "$clean"
    "$clean/bin/python" -m pip install --quiet "$out"/ohmstrain-*.whl
    try_program "$clean/bin/ohmstrain"
    "$clean/bin/python" -c 'import ohmstrain'
    rm -rf "$clean"
    made "$(echo "$out"/ohmstrain-*.whl)" "$(glibc "$folder/ohmstrain")"
}

npm() {
    [[ -x scripts/web.sh ]] || die "npm: there is no scripts/web.sh"
    scripts/web.sh --package "$out"
    cp web/dist/index.html "$out/ohmstrain-page.html"
    made "$(echo "$out"/ohmstrain-*.tgz)" "Node 20 or a browser"
    made "$out/ohmstrain-page.html" "a browser"
}

crates() {
    cargo package --quiet --locked --workspace --exclude ohmstrain-tests
    local crate
    for crate in "${CARGO_TARGET_DIR:-target}"/package/*-"$version".crate; do
        cp "$crate" "$out"
        made "$crate"
    done
}

parts=("$@")
((${#parts[@]})) || parts=(archive deb wheel npm crates)
for part in "${parts[@]}"; do
    [[ " archive deb wheel npm crates " == *" $part "* ]] || die "expected archive, deb, wheel, npm or crates, found $part"
done
mkdir -p "$out"
for part in "${parts[@]}"; do
    "$part"
done
