#!/usr/bin/env bash
# Build crates for a target that this machine's toolchain may not have: no_std crates for a Cortex-M4F/M7
# (thumbv7em-none-eabihf), unless another target is wanted.
#
#   bare-metal.sh [arguments for `cargo build`...]
#   e.g. bare-metal.sh --release --locked -p my-model -p my-ekf
#   bare-metal.sh --tools-only    makes a route ready and builds nothing
#
# Run it inside the workspace. Name the no_std crates with -p: `--workspace`
# would also pull in the host-only crates and unify their std features.
#
# Two routes, tried in this order:
#   rustup  the target's precompiled core, from rustup (already installed, or
#           fetched now by `rustup target add`);
#   debian  no precompiled core to be had: Debian's rustc-web compiler builds
#           core itself from rust-web-src (cargo's -Zbuild-std).
#
# Silent on success (compiler warnings excepted); the log of a failed step goes
# to stderr. Running it again installs and rebuilds nothing.
#
# Environment:
#   BARE_METAL_TARGET      another target, e.g. wasm32-unknown-unknown
#   BARE_METAL_STD         the crates of std that the debian route builds (core); e.g. std,panic_abort
#   BARE_METAL_ROUTE       auto (default), rustup or debian: forces one route
#   BARE_METAL_TIMEOUT     seconds allowed to `rustup target add` (60)
#   BARE_METAL_TARGET_DIR  where the artefacts go; default: bare-<route> in the
#                          workspace's own target directory
#   BARE_METAL_VERBOSE     1: say which route and compiler are used
set -euo pipefail

readonly target=${BARE_METAL_TARGET:-thumbv7em-none-eabihf}
readonly msrv=1.89.0 # rust-version of the workspace
readonly packages=(rustc-web rust-web-src)
readonly debian_rustc=/usr/bin/rustc

route=${BARE_METAL_ROUTE:-auto}
log=$(mktemp)
trap 'rm -f "$log"' EXIT

die() {
    printf 'bare-metal: %s\n' "$*" >&2
    exit 1
}

say() {
    [[ ${BARE_METAL_VERBOSE:-0} != 1 ]] || printf 'bare-metal: %s\n' "$*" >&2
}

# Runs a command silently; shows what it printed only if it fails.
quietly() {
    if ! "$@" >"$log" 2>&1; then
        cat "$log" >&2
        return 1
    fi
}

# Where this route's artefacts go. Each route has a directory of its own: two
# compilers sharing one would rebuild each other's work, and wait on its lock.
target_dir() {
    if [[ -n ${BARE_METAL_TARGET_DIR:-} ]]; then
        printf '%s\n' "$BARE_METAL_TARGET_DIR"
        return
    fi
    local manifest
    manifest=$(cargo locate-project --workspace --message-format plain) ||
        die "not inside a cargo workspace"
    printf '%s/target/bare-%s\n' "$(dirname "$manifest")" "$1"
}

# --- route 1: rustup ---------------------------------------------------------

rustup_has_target() {
    local installed
    installed=$(rustup target list --installed 2>/dev/null) || return 1
    grep -qx "$target" <<<"$installed"
}

# True once the target is installed; fetches it if need be.
rustup_ready() {
    command -v rustup >/dev/null || return 1
    rustup_has_target && return 0
    # -k: a process stuck in the network may not heed the first signal.
    timeout -k 5 "${BARE_METAL_TIMEOUT:-60}" \
        rustup target add "$target" >"$log" 2>&1 || return 1
    rustup_has_target
}

build_with_rustup() {
    [[ ${1:-} != --tools-only ]] || return 0
    local dir
    dir=$(target_dir rustup)
    say "route rustup, $(rustc -V), into $dir"
    # A RUSTC of the caller's would bypass the toolchain just checked.
    env -u RUSTC -u RUSTC_BOOTSTRAP CARGO_TARGET_DIR="$dir" \
        cargo build --quiet --target "$target" "$@"
}

# --- route 2: Debian's compiler, core built from source ----------------------

# True if both packages are installed, of one version, and recent enough.
debian_ready() {
    local compiler sources
    # shellcheck disable=SC2016  # ${...} is dpkg-query's own notation
    compiler=$(dpkg-query -W -f '${db:Status-Status} ${Version}' rustc-web 2>/dev/null) || return 1
    # shellcheck disable=SC2016
    sources=$(dpkg-query -W -f '${db:Status-Status} ${Version}' rust-web-src 2>/dev/null) || return 1
    [[ $compiler == installed\ * && $compiler == "$sources" ]] || return 1
    dpkg --compare-versions "${compiler#installed }" ge "$msrv"
}

install_debian() {
    debian_ready && return 0
    command -v apt-get >/dev/null || die "no apt-get: cannot install ${packages[*]}"
    local apt=(apt-get -q -o DPkg::Lock::Timeout=120)
    if ((EUID != 0)); then
        command -v sudo >/dev/null || die "need root to install ${packages[*]}"
        apt=(sudo "${apt[@]}")
    fi
    export DEBIAN_FRONTEND=noninteractive
    # The version needed is in the security archive: the lists must be fresh.
    quietly "${apt[@]}" update || die "apt-get update failed"
    # --no-remove: the packages conflict with Debian's own rustc, rust-src and
    # rustup, which plain `install -y` would remove without asking.
    quietly "${apt[@]}" install -y --no-remove --no-install-recommends "${packages[@]}" ||
        die "cannot install ${packages[*]}"
    debian_ready || die "Debian's rustc-web is older than $msrv (is the security archive enabled?)"
}

build_with_debian() {
    # Debian's compiler comes without cargo; any cargo of about its age will do.
    command -v cargo >/dev/null || die "no cargo in PATH (apt-get install cargo-web)"
    install_debian
    [[ ${1:-} != --tools-only ]] || return 0
    local sources dir
    sources=$("$debian_rustc" --print sysroot)/lib/rustlib/src/rust/library
    [[ -f $sources/Cargo.lock ]] || die "no standard library sources in $sources"
    dir=$(target_dir debian)
    say "route debian, $("$debian_rustc" -V), into $dir"
    # RUSTC_BOOTSTRAP=1 lets a stable cargo and rustc accept -Zbuild-std.
    # The dependencies of the whole of std are fetched once (registry access),
    # although only what is named is compiled.
    env -u RUSTC_WRAPPER RUSTC="$debian_rustc" RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR="$dir" \
        cargo build --quiet -Zbuild-std="${BARE_METAL_STD:-core}" --target "$target" "$@"
}

# --- choice ------------------------------------------------------------------

case $route in
    auto)
        if rustup_ready; then
            build_with_rustup "$@"
        else
            say "rustup cannot provide $target: $(tail -n 1 "$log")"
            build_with_debian "$@"
        fi
        ;;
    rustup)
        rustup_ready || {
            cat "$log" >&2
            die "rustup cannot provide $target"
        }
        build_with_rustup "$@"
        ;;
    debian) build_with_debian "$@" ;;
    *) die "BARE_METAL_ROUTE is '$route', not auto, rustup or debian" ;;
esac
