#!/bin/sh
# Draws the pictures of README and docs from generated scenes; needs a built `enfilade` and no display.
# Usage: scripts/pictures.sh [PATH/TO/enfilade]
set -eu
cd "$(dirname "$0")/.."
enfilade=${1:-target/release/enfilade}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$enfilade" demo -o "$work" > "$work/said"
draw() {
    name=$1
    shift
    "$enfilade" render "$work/world.glb" -o "docs/images/$name.png" --adapter software "$@"
}
# The sitting room, through its doors.
inside="--eye 1.1,1.6,7.4 --look 6.5,1.25,3.2"
# shellcheck disable=SC2086
draw portals $inside --portals --size 1200x675
# shellcheck disable=SC2086
draw above $inside --above --size 1200x675
draw house --eye 19,8.5,17 --look 5.5,2.6,4 --size 1200x675
