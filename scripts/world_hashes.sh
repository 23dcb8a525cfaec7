#!/usr/bin/env bash
# Prints `SCENE METHOD SHA256` of the world of each scene by each method, to be compared before and after a
# change that should leave all worlds the same bytes:
#
#     scripts/world_hashes.sh target/release/enfilade ../shared/scenes target/messy/faults > before.txt
#
# Scenes are all scene.glb below the folders. A bake that takes over LIMIT seconds (60) counts as `timeout`.
set -u
bin=$1
shift
world=$(mktemp --suffix=.glb)
trap 'rm -f "$world"' EXIT
find "$@" -name scene.glb | sort | while read -r scene; do
    folder=$(dirname "$scene")
    detail=()
    [ -f "$folder/detail.glb" ] && detail=(--detail "$folder/detail.glb")
    for method in watershed bsp delaunay; do
        rm -f "$world"
        timeout "${LIMIT:-60}" "$bin" bake "$scene" "${detail[@]}" --method "$method" -o "$world" \
            >/dev/null 2>&1 </dev/null
        case $? in
            0) hash=$(sha256sum <"$world" | cut -d' ' -f1) ;;
            124) hash=timeout ;;
            *) hash=refused ;;
        esac
        echo "$(basename "$folder") $method $hash"
    done
done
