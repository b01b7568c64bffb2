#!/usr/bin/env bash
# Builds the documentation as a site in target/site: the guide, the pages of docs/ and of each part as one book, and the API by
# `cargo doc`, under one index; then checks every link within it.
#
# Installs mdbook and LinkChecker into target/site-tools if they are missing.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
readonly target
readonly tools=$target/site-tools site=$target/site
PATH=$tools/bin:$PATH

mkdir -p "$tools/bin"
command -v mdbook >/dev/null || cargo install --quiet --locked --root "$tools" --version '^0.5' --no-default-features mdbook
if ! command -v linkchecker >/dev/null; then
    "${PYTHON3:-python3}" -m venv "$tools/python"
    "$tools/python/bin/pip" install --quiet 'LinkChecker>=10.5'
    ln -sf "$tools/python/bin/linkchecker" "$tools/bin/linkchecker"
fi

rm -rf "$site" "$target/doc"
scripts/site-book.py "$target/site-book"
mdbook build --dest-dir "$site" "$target/site-book"
RUSTDOCFLAGS="-D warnings" cargo doc --locked --quiet --workspace --no-deps --all-features --exclude ohmstrain-tests
cp -r "$target/doc" "$site/api"

cat >"$target/site-book/linkcheckerrc" <<'RC'
[AnchorCheck]
RC
# rustdoc has checked the links of its own pages.
linkchecker --config "$target/site-book/linkcheckerrc" --no-status --no-follow-url '/site/api/' "$site/index.html"
echo "$site/index.html"
