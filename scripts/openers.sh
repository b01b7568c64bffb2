#!/usr/bin/env bash
# Fails where the first sentence of a doc comment begins with a word that hides its subject: CONTRIBUTING.md, "English".
# Comments before functions and constants of exported C are checked, too.
# scripts/openers.sh [--list] [PATH...]: --list only lists, without failing; the default path is the sources of all crates.
set -euo pipefail
cd "$(dirname "$0")/.."

forbidden='What|Whether|How|Where|Which|Why|That|When|If|Once|Who|Whose|Whom|Of|As|With|Without|By|In|On|At|To|Up to|Since|Until'
forbidden+='|While|So|Such|Says|Hears|Told|There|Goes|(For|From) (how|what|which|when|whom|whose)|Every how'

list=false
if [ "${1-}" = --list ]; then
    list=true
    shift
fi
[ $# -gt 0 ] || set -- crates/*/src

found=$(find "$@" -name '*.rs' -not -path '*/target/*' -print0 | sort -z | xargs -0 awk -v forbidden="^($forbidden)([^[:alnum:]_]|$)" '
    FNR == 1 { before = "" }
    {
        kind = ""
        if (match($0, /^[ \t]*\/\/[\/!]( |$)/)) {
            kind = substr($0, RSTART, RLENGTH)
            text = substr($0, RSTART + RLENGTH)
            gsub(/[ \t]/, "", kind)
        }
        if (kind != "" && kind != before && text ~ forbidden) {
            print FILENAME ":" FNR ": " text
        }
        before = kind
    }')
found+=$(find "$@" \( -name '*.c' -o -name '*.h' -o -name '*.ino' \) -not -path '*/target/*' -print0 | sort -z | xargs -0 -r awk -v forbidden="^(/\\*|//) ($forbidden)([^[:alnum:]_]|$)" '
    $0 ~ forbidden && !(before ~ /^\/\//) { print FILENAME ":" FNR ": " $0 }
    { before = $0 }')
if [ -z "$found" ]; then
    exit 0
fi
printf '%s\n' "$found"
if ! $list; then
    echo "openers.sh: begin with a noun phrase (a thing) or a verb (a function); for a truth value, \"True if …\"" >&2
    exit 1
fi
