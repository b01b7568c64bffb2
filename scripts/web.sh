#!/usr/bin/env bash
# Builds the page: WebAssembly of crates/web, then web/dist, one file that any static host shows and that opens from a disk.
#
#   web.sh               web/dist/index.html, and the npm package in web/dist-package
#   web.sh --test        and everything that is tested about them, in Chromium and in Node; pictures in web/dist-pictures
#   web.sh --picture     and the picture of the README
#   web.sh --package DIR and the npm package, tried in a clean folder, as a file in DIR
#   web.sh --tools-only  fails, and says why, where it cannot be built
#
# The WebAssembly is built as scripts/bare-metal.sh builds: with rustup's target, or with Debian's rustc-web and rust-web-src.
#
# Environment:
#   OHMSTRAIN         the program that the page is compared with; default: that of target/release or target/debug, built if need be
#   CARGO_TARGET_DIR  where builds go; default: target
#   BARE_METAL_ROUTE  rustup or debian: forces one route
set -euo pipefail
cd "$(dirname "$0")/.."
readonly target=${CARGO_TARGET_DIR:-$PWD/target}
readonly oldest_node=20

die() {
    printf 'web: %s\n' "$*" >&2
    exit 1
}

tools() {
    command -v npm >/dev/null || die "no npm in PATH"
    local version
    version=$(node -p 'process.versions.node.split(".")[0]')
    ((version >= oldest_node)) || die "node $version is older than $oldest_node"
    if ! cmp -s web/package-lock.json web/node_modules/.made-from; then
        (cd web && npm ci --no-audit --no-fund --loglevel=error >&2) || die "npm ci failed"
        cp web/package-lock.json web/node_modules/.made-from
    fi
    (cd crates/web && for_wasm ../../scripts/bare-metal.sh --tools-only)
}

# Runs a command with what scripts/bare-metal.sh is to know of the target.
for_wasm() {
    BARE_METAL_TARGET=wasm32-unknown-unknown BARE_METAL_STD=std,panic_abort BARE_METAL_TARGET_DIR=$target/web \
        CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(linker) \
        CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-C target-feature=+simd128" "$@"
}

# rust-lld of the toolchain: Debian's compiler comes without a linker for WebAssembly.
linker() {
    local found
    found=$(find "$(rustc --print sysroot)/lib/rustlib" -name rust-lld -type f 2>/dev/null | head -n 1)
    echo "${found:-wasm-ld}"
}

wasm() {
    (
        cd crates/web
        for_wasm ../../scripts/bare-metal.sh --release --locked -p ohmstrain-web
        CARGO_TARGET_DIR=$target/web cargo build --quiet --locked -p ohmstrain-web-bindgen
    )
    rm -rf web/pkg
    "$target/web/debug/ohmstrain-web-bindgen" "$target/web/wasm32-unknown-unknown/release/ohmstrain_web.wasm" web/pkg
}

page() {
    (cd web && npm run --silent build >&2)
    local bytes packed
    bytes=$(wc -c <web/dist/index.html)
    packed=$(gzip -9 -c web/dist/index.html | wc -c)
    echo "page: $bytes bytes, $packed over the wire (gzip); WebAssembly: $(wc -c <web/pkg/ohmstrain_bg.wasm)"
    ((packed <= 2000000)) || die "the page takes more than 2 MB over the wire"
}

# What `npm publish` would take, in web/dist-package.
package() {
    rm -rf web/dist-package
    mkdir web/dist-package
    cp web/package/{package.json,README.md,index.d.ts,node.js,browser.js} web/pkg/ohmstrain{.js,.d.ts,_bg.wasm} web/dist-package
}

# The package, installed into a clean folder and run; a copy of it goes to a folder that is named.
try_package() {
    local clean
    clean=$(mktemp -d)
    (cd web/dist-package && npm pack --silent --pack-destination "$clean" >/dev/null)
    [[ -z ${1:-} ]] || cp "$clean"/ohmstrain-*.tgz "$1"
    cp web/package/try.mjs "$clean"
    (cd "$clean" && npm init --yes >/dev/null && npm install --silent --no-audit --no-fund --offline ./ohmstrain-*.tgz && node try.mjs)
    rm -rf "$clean"
}

program() {
    local built
    for built in release debug; do
        [[ -n ${OHMSTRAIN:-} || ! -x $target/$built/ohmstrain ]] || OHMSTRAIN=$target/$built/ohmstrain
    done
    export OHMSTRAIN=${OHMSTRAIN:-$target/debug/ohmstrain}
    [[ -x $OHMSTRAIN ]] || cargo build --quiet --locked -p ohmstrain-cli
    # Its elementary functions are to be those of WebAssembly: the system's differ in last bits.
    (cd crates/web && CARGO_TARGET_DIR=$target/web cargo build --quiet --locked --release -p ohmstrain-same-libm)
    export OHMSTRAIN_SAME_LIBM=$target/web/release/libohmstrain_same_libm.so
}

tools
[[ ${1:-} != --tools-only ]] || exit 0
wasm
page
package
if [[ ${1:-} == --test || ${1:-} == --picture ]]; then
    program
    scripts/chromium.sh
    (cd web && npm test --silent)
    try_package
fi
[[ ${1:-} != --package ]] || try_package "$2"
[[ ${1:-} != --picture ]] || cp web/dist-pictures/readme.png docs/page.png
