#!/usr/bin/env bash
# A stripped binary with manual pages, completions and licences, as dist/ohmstrain-VERSION-TARGET.tar.gz.
#
#   dist.sh [--target TRIPLE]    another target's binary must run here, for the pages
#
# Environment:
#   BUILD           cargo's command that builds it; default: build. zigbuild brings a C compiler for targets with another C library
#   OHMSTRAIN_PAGE  the page that `ohmstrain serve` shows; default: web/dist/index.html, made by web.sh if need be; empty: none
set -euo pipefail
cd "$(dirname "$0")/.."

case "${1:-}" in
'' | --target) ;;
*)
    echo "usage: $0 [--target TRIPLE]" >&2
    exit 2
    ;;
esac
target=${2:-$(rustc -vV | sed -n 's/^host: //p')}
if [[ -z ${OHMSTRAIN_PAGE+set} ]]; then
    export OHMSTRAIN_PAGE=$PWD/web/dist/index.html
    [[ -f $OHMSTRAIN_PAGE ]] || scripts/web.sh >&2
fi
OHMSTRAIN_COMMIT=$(git rev-parse HEAD 2>/dev/null || true) \
    cargo "${BUILD:-build}" --locked --profile dist -p ohmstrain-cli --target "$target"
binary=${CARGO_TARGET_DIR:-target}/$target/dist/ohmstrain

name=ohmstrain-$("$binary" --version | cut -d' ' -f2)-$target
rm -rf "dist/$name"
mkdir -p "dist/$name/completions"
cp "$binary" README.md ARCHITECTURE.md CONTRIBUTING.md NOTATION.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "dist/$name"
cp -r docs guide "dist/$name"
# What README and docs refer to.
cp --parents crates/ohmstrain/examples/live.rs crates/python/examples/ohmstrain.ipynb {bench,embedded,crates/c,web/package}/README.md "dist/$name"
"$binary" man -o "dist/$name/man"
# Named as each shell looks for them.
for file in bash:ohmstrain.bash zsh:_ohmstrain fish:ohmstrain.fish powershell:_ohmstrain.ps1 elvish:ohmstrain.elv; do
    "$binary" completions "${file%%:*}" >"dist/$name/completions/${file#*:}"
done
tar -C dist -czf "dist/$name.tar.gz" "$name"
ls -l "$binary" "dist/$name.tar.gz"
