#!/usr/bin/env bash
# Writes the flags of every command into its page: the blocks of docs/commands/*.md between
# `<!-- generated: ohmstrain COMMAND --help -->` and `<!-- end -->`.
#
#   commands.sh           writes them
#   commands.sh --check   fails if a page differs, or a command has no page
#
# Environment:
#   OHMSTRAIN  the program; default: target/release/ohmstrain
set -euo pipefail
cd "$(dirname "$0")/.."
readonly check=${1:-} ohmstrain=${OHMSTRAIN:-target/release/ohmstrain} pages=docs/commands
[[ $check == --check || $# -eq 0 ]] || { echo "usage: commands.sh [--check]" >&2; exit 2; }
[[ -x $ohmstrain ]] || { echo "no program at $ohmstrain: build it, or set OHMSTRAIN" >&2; exit 2; }
page=$(mktemp)
trap 'rm -f "$page"' EXIT

# help WORD...: the long help, at the same width in a terminal and without one.
help() { COLUMNS=100 NO_COLOR=1 "$ohmstrain" "$@" --help </dev/null 2>&1 | sed 's/[[:space:]]*$//'; }

# filled FILE: the page with its blocks as the program has them.
filled() {
    local line command is_old=
    while IFS= read -r line; do
        if [[ $line =~ ^'<!-- generated: ohmstrain '(.*)' --help -->'$ ]]; then
            command=${BASH_REMATCH[1]} is_old=1
            printf '%s\n```text\n' "$line"
            # shellcheck disable=SC2086 # `fleet fit` is two words
            help $command
            printf '```\n'
        elif [[ $line == '<!-- end -->' ]]; then
            is_old=
            printf '%s\n' "$line"
        elif [[ -z $is_old ]]; then
            printf '%s\n' "$line"
        fi
    done <"$1"
    [[ -z $is_old ]] || { echo "$1: a generated block without an end" >&2; return 1; }
}

bad=0
for file in "$pages"/*.md; do
    filled "$file" >"$page"
    cmp -s "$page" "$file" && continue
    if [[ -n $check ]]; then
        echo "$file is out of date: run scripts/commands.sh" >&2
        diff "$file" "$page" | head -n 20 >&2 || true
        bad=1
    else
        cat "$page" >"$file"
    fi
done

for command in $(help | sed -n '/^Commands:/,/^$/s/^  \([a-z][a-z-]*\) .*/\1/p'); do
    if [[ $command != help ]] && ! grep -qsF "<!-- generated: ohmstrain $command --help -->" "$pages/$command.md"; then
        echo "$pages/$command.md is missing, or has no block for the flags of $command" >&2
        bad=1
    fi
done
exit $bad
