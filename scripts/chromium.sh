#!/usr/bin/env bash
# Installs what crates/cli/tests/browser.rs needs, where it is missing and this may: Chromium, and a font
# without serifs.
set -euo pipefail

has() { command -v "$1" >/dev/null; }
if ! { has chromium || has chromium-browser || has google-chrome || has chrome; } ||
    ! compgen -G "/usr/share/fonts/truetype/*/*Sans*.ttf" >/dev/null; then
    "$(dirname "$0")/apt.sh" chromium fonts-dejavu-core
fi
