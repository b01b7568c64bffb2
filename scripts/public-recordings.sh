#!/usr/bin/env bash
# Downloads the public recordings that docs/accuracy.md names, with their licences. They are not part of this repository.
#
#   public-recordings.sh FOLDER
#
# `ohmstrain inspect FILE` then says what is in one, and which command makes a trace of it; the gauge length of the
# carbon-black rig is 40 mm.
set -euo pipefail
[[ $# -eq 1 ]] || { echo "usage: $(basename "$0") FOLDER" >&2; exit 2; }
mkdir -p "$1"

# fetched OWNER/NAME WHAT
fetched() {
    local folder=$1/${2#*/} licence
    [[ -d $folder ]] || git clone --quiet --depth 1 "https://github.com/$2" "$folder"
    licence=$(find "$folder" -maxdepth 1 -iname 'licen[cs]e*' | head -n 1)
    echo "$folder: $3; $(git -C "$folder" rev-parse --short HEAD)"
    if [[ -n $licence ]]; then
        echo "  licence: $(grep -m 1 . "$licence"), in $licence"
    else
        echo "  no licence: ask its authors before you pass it on"
    fi
}

fetched "$1" richgumy/electromech-stretcher "carbon black in silicone, ramps, sines, sawtooth, holds"
fetched "$1" vistormu/catasta "silver-coated nylon, sine and triangle"
fetched "$1" e-Body-Lab/graphene-based-knitted-sensing-sleeve "graphene knit on knees and elbows, motion capture"
