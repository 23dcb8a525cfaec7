#!/usr/bin/env python3
"""Lengths of the shortest ways through the air of a baked world, by fast marching on voxels (Sethian 1996).

    python3 scripts/fmm_lengths.py WORLD.glb VOXEL [SOURCES] > crates/enfilade-bench/peers/fmm-SCENE.csv

Needs `numpy`, `scipy` and `scikit-fmm`. Everything is open: walls are the structure alone, without leaves, panes and
furniture. A voxel is solid if a wall crosses a line between the centers of two neighbors in it: no wall is open between
neighbors, and none is thicker than a voxel. Points are by chance in the box of the structure and 2 m around it, indoors and
out, 0.3 m or more from walls; those that no way joins are left out. 500 pairs, with as many ends for each of the sources, 25 by
default: each costs a march.
"""

import json
import struct
import sys

import numpy as np
import skfmm
from scipy.ndimage import distance_transform_edt

N_PAIRS = 500
CLEAR = 0.3
AROUND = 2.0


def structure(path):
    """Triangles of all meshes below nodes that are structure, `[n][3][3]`."""
    data = open(path, "rb").read()
    (size,) = struct.unpack_from("<I", data, 12)
    gltf = json.loads(data[20 : 20 + size])
    base = 20 + size + 8
    kinds = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}

    def read(index):
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        wide = 3 if accessor["type"] == "VEC3" else 1
        at = base + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        values = np.frombuffer(data, kinds[accessor["componentType"]], accessor["count"] * wide, at)
        return values.reshape(-1, wide) if wide > 1 else values

    found = []

    def visit(index):
        node = gltf["nodes"][index]
        if node.get("name") in ("details", "fixtures", "enfilade leak path"):
            return
        if "mesh" in node:
            for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
                corners = read(primitive["attributes"]["POSITION"]).astype(float)
                found.append(corners[read(primitive["indices"]).astype(int).reshape(-1, 3)])
        for child in node.get("children", []):
            visit(child)

    for index in gltf["scenes"][gltf.get("scene", 0)]["nodes"]:
        visit(index)
    return np.concatenate(found)


def voxels(triangles, origin, h, shape):
    """Marks the voxels in which a triangle crosses a line of centers along an axis."""
    solid = np.zeros(shape, bool)
    for triangle in (triangles - origin) / h - 0.5:
        for axis in range(3):
            u, v = [k for k in range(3) if k != axis]
            low = np.maximum(np.ceil(triangle.min(0) - 1e-9).astype(int), 0)
            high = np.minimum(np.floor(triangle.max(0) + 1e-9).astype(int), np.array(shape) - 1)
            if low[u] > high[u] or low[v] > high[v]:
                continue
            a, b, c = triangle
            area = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])
            if abs(area) < 1e-12:
                continue
            x, y = np.meshgrid(np.arange(low[u], high[u] + 1), np.arange(low[v], high[v] + 1), indexing="ij")
            s = ((x - a[u]) * (c[v] - a[v]) - (y - a[v]) * (c[u] - a[u])) / area
            t = ((b[u] - a[u]) * (y - a[v]) - (b[v] - a[v]) * (x - a[u])) / area
            inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
            depth = a[axis] + s * (b[axis] - a[axis]) + t * (c[axis] - a[axis])
            along = np.rint(depth[inside]).astype(int)
            at = [None] * 3
            at[u], at[v], at[axis] = x[inside], y[inside], along
            keep = (along >= 0) & (along < shape[axis])
            solid[tuple(k[keep] for k in at)] = True
    return solid


def main():
    path, h = sys.argv[1], float(sys.argv[2])
    most = int(sys.argv[3]) if len(sys.argv) > 3 else 25
    n_each = N_PAIRS // most
    triangles = structure(path)
    low = triangles.min((0, 1)) - AROUND
    high = triangles.max((0, 1)) + AROUND
    shape = tuple(int(np.ceil(n)) for n in (high - low) / h)
    solid = voxels(triangles, low, h, shape)
    clear = distance_transform_edt(~solid) * h >= CLEAR + h
    free = np.argwhere(clear)
    rng = np.random.default_rng(1)
    centers = [low[k] + (np.arange(shape[k]) + 0.5) * h for k in range(3)]
    print("x,y,z,x,y,z,length")
    n_sources = 0
    while n_sources < most:
        source = free[rng.integers(len(free))]
        start = low + (source + 0.5) * h
        squares = [((centers[k] - start[k]) ** 2).reshape([-1 if j == k else 1 for j in range(3)]) for k in range(3)]
        # The front starts as a sphere that touches no wall.
        phi = np.ma.MaskedArray(np.sqrt(squares[0] + squares[1] + squares[2]) - CLEAR, solid)
        length = skfmm.distance(phi, h, order=2) + CLEAR
        ends = free[rng.permutation(len(free))[: 50 * n_each]]
        found = [(end, length[tuple(end)]) for end in ends]
        found = [(end, far) for end, far in found if far is not np.ma.masked and far > 2.0][:n_each]
        # Within a solid, nothing is reached.
        if len(found) < n_each:
            continue
        n_sources += 1
        print(f"{n_sources} of {most}", file=sys.stderr, flush=True)
        for end, far in found:
            stop = low + (end + 0.5) * h
            print(",".join(f"{x:.4f}" for x in [*start, *stop, far]), flush=True)


if __name__ == "__main__":
    main()
