#!/bin/sh
# Delaunay tetrahedra of random points and of a 46³ lattice, ours beside CGAL's and TetGen's.
# usage: bench_delaunay.sh PEERS [REPEATS]
# PEERS is a folder with delaunay_cgal, a program that takes `points.f64 seq 1 REPEATS NAME` and prints
# a JSON line with user_s; without it only ours is timed. TetGen is run when it is installed.
set -eu
peers=$1
repeats=${2:-3}
cargo build --release -p enfilade-bake --example delaunay_bench
ours=${CARGO_TARGET_DIR:-target}/release/examples/delaunay_bench
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 - "$work" <<'P'
import array, random, sys
random.seed(7)
for name, n in (("1e4", 10**4), ("1e5", 10**5), ("1e6", 10**6)):
    array.array("d", (random.random() for _ in range(3 * n))).tofile(open(f"{sys.argv[1]}/{name}.f64", "wb"))
side = [float(i) for i in range(46)]
lattice = array.array("d", (v for x in side for y in side for z in side for v in (x, y, z)))
lattice.tofile(open(f"{sys.argv[1]}/grid46.f64", "wb"))
P
for name in 1e4 1e5 grid46 1e6; do
    "$ours" "$work/$name.f64" "$repeats" "$name"
    if [ -x "$peers/delaunay_cgal" ]; then
        "$peers/delaunay_cgal" "$work/$name.f64" seq 1 "$repeats" "$name"
    fi
    if command -v tetgen > /dev/null; then
        python3 - "$work/$name" <<'P'
import array, os, sys
a = array.array("d")
a.frombytes(open(sys.argv[1] + ".f64", "rb").read())
with open(sys.argv[1] + ".node", "w") as out:
    out.write(f"{len(a) // 3} 3 0 0\n")
    for i in range(0, len(a), 3):
        out.write(f"{i // 3 + 1} {a[i]!r} {a[i + 1]!r} {a[i + 2]!r}\n")
P
        tetgen -NEF "$work/$name.node" | grep -E 'Delaunay seconds|Mesh tetrahedra' | tr '\n' ' '
        echo "tetgen $name"
    fi
done
