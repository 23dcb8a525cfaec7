#!/bin/sh
# Draws the pictures and plans of README and docs from generated scenes; needs a built `enfilade` and no display.
# Usage: scripts/pictures.sh [PATH/TO/enfilade]
set -eu
cd "$(dirname "$0")/.."
enfilade=${1:-target/release/enfilade}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$enfilade" demo -o "$work" > "$work/said"
# A corridor of offices says more than a house of few rooms.
cargo run -q --release -p enfilade-testkit --example generate -- tower --rooms 64 -o "$work/tower" > "$work/said"
"$enfilade" bake "$work/tower/scene.glb" --detail "$work/tower/detail.glb" -o "$work/tower.glb" > "$work/said" 2>&1
draw() {
    world=$1
    name=$2
    shift 2
    "$enfilade" render "$work/$world.glb" -o "docs/images/$name.png" --adapter software "$@"
}
# In the corridor, through its doors.
inside="--eye 14.71,4.80,7.65 --look 13.79,4.72,8.03 --fov 63"
# shellcheck disable=SC2086
draw tower portals $inside --portals --size 1200x675
# shellcheck disable=SC2086
draw tower above $inside --above --size 1200x675
# A storey with its ceiling taken off.
draw tower cells --paint cells --mode everything --cut 5.4 --eye 5,17,24 --look 11.6,4,8 --fov 60 --size 1200x675
# Where the command itself would stand.
draw world room --size 1200x675
draw world house --eye 24,9.5,21 --look 5.5,4.2,4 --size 1200x675
draw world rooms --paint cells --mode everything --cut 2.55 --eye 16,13,17 --look 5.2,0.4,4.5 --fov 33 --size 1200x675
draw world doors --eye 0.9,1.6,2.2 --look 4.35,1.15,4.2 --door 19=0.5 --size 1200x675
# Plans; the house as SVG, too.
"$enfilade" plan "$work/world.glb" -o docs/images/plan.svg
"$enfilade" plan "$work/world.glb" -o docs/images/plan.png --width 1400
"$enfilade" plan "$work/tower.glb" -o docs/images/tower.png --width 1600
# What other trades take away; needs `pip install pillow`.
python3 scripts/exports_picture.py "$enfilade" "$work/world.glb" docs/images/exports.png
