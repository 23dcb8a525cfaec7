#!/usr/bin/env python3
"""Times the voxel kernels beside other open implementations, in one run, and prints a table.

Each case runs ours and the peer by turns, each call in a process of its own, so that whatever
else the machine does hits both. What counts is the ratio of the medians of user CPU time (all
threads, system time apart); a time by itself says little.

  cargo build --release -p enfilade-voxel --example kernel_bench
  scripts/bench_kernels.py --bench target/release/examples/kernel_bench --data DIR [--peers DIR]

DIR of --data holds STEM.npy (a byte a voxel, [z][y][x], 1 for air), STEM.labels.npy (the room of
each voxel, 0 for none) and, for voxelization, STEM.glb, for the stems b256 and b512. Where they
are missing, make_building.py in the folder of --peers makes them. Peers come from PyPI: edt,
connected-components-3d, SimpleITK, open3d, numpy; one that is not installed is reported and left
out. The options default to the environment's BENCH_BIN, PEERS_DATA and PEERS_DIR.
"""
import argparse
import importlib.util
import json
import os
import resource
import statistics
import struct
import subprocess
import sys
import tempfile
import time

STANDARD = {
    "b256": "--rooms 42 --floors 8 --res 256 --cube --npy --labels",
    "b512": "--rooms 42 --floors 8 --res 512 --cube --npy --labels --target-tris 200000 --glb",
}

# name: kernel of ours, peer, module, stem, threads, rounds, repeats of ours and of the peer a round
CASES = {
    "edt 256, 1 thread": ("edt-f32", "edt", "edt", "b256", 1, 5, 3, 3),
    "edt 256, all threads": ("edt-f32", "edt", "edt", "b256", 0, 5, 3, 3),
    "edt 512, 1 thread": ("edt-f32", "edt", "edt", "b512", 1, 3, 2, 1),
    "edt 512, all threads": ("edt-f32", "edt", "edt", "b512", 0, 3, 2, 1),
    "edt squared 256, 1 thread": ("edt-u16", "edtsq", "edt", "b256", 1, 5, 3, 3),
    "edt squared 512, 1 thread": ("edt-u16", "edtsq", "edt", "b512", 1, 3, 2, 1),
    "edt squared 512, all threads": ("edt-u16", "edtsq", "edt", "b512", 0, 3, 2, 1),
    "components 512 air, 6": ("components6", "cc3d6", "cc3d", "b512", 1, 5, 2, 2),
    "components 512 rooms, 6": ("components6", "cc3d6", "cc3d", "b512/rooms", 1, 5, 2, 2),
    "components 512 air, 26": ("components26", "cc3d26", "cc3d", "b512", 1, 5, 2, 2),
    "components 512 rooms, 26": ("components26", "cc3d26", "cc3d", "b512/rooms", 1, 5, 2, 2),
    "watershed 256": ("watershed", "sitk", "SimpleITK", "b256", 1, 3, 2, 1),
    "watershed 512": ("watershed", "sitk", "SimpleITK", "b512", 1, 1, 2, 1),
    "voxelize 200k at 512": ("voxelize", "open3d", "open3d", "b512", 1, 3, 3, 1),
}
DISTRIBUTION = {"edt": "edt", "cc3d": "connected-components-3d", "SimpleITK": "simpleitk", "open3d": "open3d"}


def volume(data, stem):
    """A byte a voxel, 1 for air (or, for STEM/rooms, for air inside rooms)."""
    import numpy as np
    stem, _, part = stem.partition("/")
    name = os.path.join(data, stem)
    source = np.load(name + (".labels.npy" if part else ".npy"))
    return (source > 0).astype(np.uint8)


def mesh(path):
    """Positions and triangles of a GLB with one indexed primitive."""
    import numpy as np
    raw = open(path, "rb").read()
    length = struct.unpack("<I", raw[12:16])[0]
    views = json.loads(raw[20:20 + length])["bufferViews"]
    start = 28 + length
    v, t = views[:2]
    vertices = np.frombuffer(raw, "<f4", v["byteLength"] // 4, start + v["byteOffset"]).reshape(-1, 3)
    triangles = np.frombuffer(raw, "<u4", t["byteLength"] // 4, start + t["byteOffset"]).reshape(-1, 3)
    return vertices, triangles


def voxel_edge(vertices, res=512):
    return float((vertices.max(0) - vertices.min(0)).max()) / res


def status(field):
    for line in open("/proc/self/status"):
        if line.startswith(field):
            return int(line.split()[1]) / 1024
    return 0.0


def worker(peer, data, stem, threads, repeats, h, out):
    """One peer, in this process; prints the same record as our binary."""
    import numpy as np
    if peer == "open3d":
        import open3d
        vertices, triangles = mesh(os.path.join(data, stem + ".glb"))
        edge = voxel_edge(vertices)
        soup = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(vertices.astype(float)),
            open3d.utility.Vector3iVector(triangles.astype(np.int32)))
        call = lambda: open3d.geometry.VoxelGrid.create_from_triangle_mesh(soup, edge)
        describe = lambda o: {"set": len(o.get_voxels())}
    else:
        air = volume(data, stem)
        if peer in ("edt", "edtsq"):
            import edt
            transform = getattr(edt, peer)
            call = lambda: transform(air, parallel=threads)
            describe = lambda o: {"sum": float(o.sum(dtype=np.float64))}
        elif peer in ("cc3d6", "cc3d26"):
            import cc3d
            call = lambda: cc3d.connected_components(air, connectivity=int(peer[4:]))
            describe = lambda o: {"components": int(o.max())}
        elif peer == "sitk":
            import edt
            import SimpleITK
            SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
            relief = SimpleITK.GetImageFromArray(-edt.edt(air, parallel=threads))
            call = lambda: SimpleITK.MorphologicalWatershed(
                relief, level=h, markWatershedLine=True, fullyConnected=False)

            def describe(image):
                labels = np.where(air > 0, SimpleITK.GetArrayFromImage(image), 0).astype(np.uint32)
                labels.tofile(out)
                return {"basins": len(np.unique(labels)) - 1}
    times = {"user_s": [], "sys_s": [], "wall_s": []}
    peak = 0.0
    answer = None
    for _ in range(repeats):
        answer = None
        try:
            open("/proc/self/clear_refs", "w").write("5")
        except OSError:
            pass
        resident = status("VmRSS")
        before, wall = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
        answer = call()
        times["wall_s"].append(time.perf_counter() - wall)
        after = resource.getrusage(resource.RUSAGE_SELF)
        times["user_s"].append(after.ru_utime - before.ru_utime)
        times["sys_s"].append(after.ru_stime - before.ru_stime)
        peak = max(peak, status("VmHWM") - resident)
    print(json.dumps(times | {"peak_mib": round(peak, 1)} | describe(answer)))


def rooms_matched(data, stem, labels_path):
    """Rooms whose most frequent basin has that room as its most frequent room, and their number."""
    import numpy as np
    true = np.load(os.path.join(data, stem + ".labels.npy")).astype(np.int64).ravel()
    labels = np.fromfile(labels_path, np.uint32).astype(np.int64)
    n_basins, n_rooms = int(labels.max()), int(true.max())
    both = (true > 0) & (labels > 0)
    pairs, counts = np.unique(true[both] * (n_basins + 1) + labels[both], return_counts=True)
    room, basin = pairs // (n_basins + 1), pairs % (n_basins + 1)
    by_room, by_basin = np.lexsort((counts, room)), np.lexsort((counts, basin))
    best_basin = dict(zip(room[by_room], basin[by_room]))
    best_room = dict(zip(basin[by_basin], room[by_basin]))
    return sum(best_room.get(b) == r for r, b in best_basin.items()), n_rooms


def prepared(args, stem):
    """Raw inputs of a stem for our binary, made on first use in a temporary folder."""
    import numpy as np
    plain = stem.partition("/")[0]
    if not os.path.exists(os.path.join(args.data, plain + ".npy")):
        generator = os.path.join(args.peers or "", "make_building.py")
        if not args.peers or not os.path.exists(generator):
            sys.exit(f"no {plain}.npy in {args.data}; give the folder of make_building.py with --peers")
        os.makedirs(args.data, exist_ok=True)
        subprocess.run([sys.executable, generator, "--out", os.path.join(args.data, plain)]
                       + STANDARD[plain].split(), check=True, stdout=subprocess.DEVNULL)
    raw = os.path.join(args.scratch, stem.replace("/", "-") + ".raw")
    if not os.path.exists(raw):
        volume(args.data, stem).tofile(raw)
    return raw


def triangles_file(args):
    import numpy as np
    raw = os.path.join(args.scratch, "triangles.raw")
    vertices, triangles = mesh(os.path.join(args.data, "b512.glb"))
    edge = voxel_edge(vertices)
    low = vertices.min(0).astype(float)
    # The peer's grid starts half a voxel below the mesh; ours likewise, so that both do the same.
    ((vertices[triangles].astype(float) - low) / edge + 0.5).tofile(raw)
    dims = np.floor((vertices.max(0) - low) / edge + 0.5).astype(int) + 1
    return raw, [str(d) for d in dims]


def run(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def compare(args, name):
    kernel, peer, module, stem, threads, rounds, repeats, peer_repeats = CASES[name]
    if importlib.util.find_spec(module) is None or (peer == "sitk" and importlib.util.find_spec("edt") is None):
        print(f"peer missing: {name} needs {DISTRIBUTION[module]}; not measured", file=sys.stderr)
        return None
    threads = threads or os.cpu_count()
    raw = prepared(args, stem)
    side = stem[1:4]
    dims = [side] * 3
    if kernel == "voxelize":
        raw, dims = triangles_file(args)
    labels = {who: os.path.join(args.scratch, who + ".labels") for who in ("ours", "peer")}
    ours_command = [args.bench, kernel, raw, *dims, "--threads", str(threads),
                    "--repeats", str(repeats), "--h", str(args.h)]
    if kernel == "watershed":
        ours_command += ["--out", labels["ours"]]
    peer_command = [sys.executable, os.path.abspath(__file__), "--data", args.data, "--worker", peer, "--stem", stem,
                    "--threads", str(threads), "--repeats", str(peer_repeats), "--h", str(args.h),
                    "--out", labels["peer"]]
    ours, theirs = [], []
    for _ in range(args.rounds or rounds):
        ours.append(run(ours_command))
        theirs.append(run(peer_command))
    middle = lambda records, key: statistics.median(t for r in records for t in r[key])
    if kernel == "edt-f32":
        a, b = ours[-1]["sum"], theirs[-1]["sum"]
        # Both sum exact roots of integers, each rounded to 24 bits.
        assert abs(a - b) <= 1e-6 * b, f"distances differ: {a} and {b}"
    if kernel.startswith("components"):
        assert ours[-1]["components"] == theirs[-1]["components"], "numbers of components differ"
    remark = []
    for who, record in (("ours", ours[-1]), ("peer", theirs[-1])):
        if kernel == "watershed":
            matched, n_rooms = rooms_matched(args.data, stem, labels[who])
            remark.append(f"{who}: {record['basins']} basins, {matched}/{n_rooms} rooms")
        elif kernel == "voxelize":
            remark.append(f"{who}: {record['set'] / 1e6:.2f} M voxels")
    from importlib.metadata import version
    row = {
        "case": name, "peer": f"{DISTRIBUTION[module]} {version(DISTRIBUTION[module])}",
        "ours": middle(ours, "user_s"), "theirs": middle(theirs, "user_s"),
        "wall": middle(theirs, "wall_s") / middle(ours, "wall_s"),
        "ours_mib": ours[-1]["peak_mib"], "theirs_mib": theirs[-1]["peak_mib"], "remark": "; ".join(remark),
    }
    print(json.dumps(row), file=sys.stderr, flush=True)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    environment = os.environ.get
    parser.add_argument("--bench", default=environment("BENCH_BIN", "target/release/examples/kernel_bench"))
    parser.add_argument("--data", default=environment("PEERS_DATA", "peers-data"))
    parser.add_argument("--peers", default=environment("PEERS_DIR"), help="folder of make_building.py")
    parser.add_argument("--only", default="", help="comma-separated parts of case names")
    parser.add_argument("--rounds", type=int, help="instead of each case's own")
    parser.add_argument("--h", type=float, default=2.0, help="least depth of a basin, in voxels")
    for hidden in ("--worker", "--stem", "--out"):
        parser.add_argument(hidden, help=argparse.SUPPRESS)
    parser.add_argument("--threads", type=int, default=1, help=argparse.SUPPRESS)
    parser.add_argument("--repeats", type=int, default=1, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return worker(args.worker, args.data, args.stem, args.threads, args.repeats, args.h, args.out)
    if importlib.util.find_spec("numpy") is None:
        sys.exit("numpy is needed to read the inputs: pip install numpy")
    if not os.path.exists(args.bench):
        sys.exit(f"no {args.bench}; build it: cargo build --release -p enfilade-voxel --example kernel_bench")
    wanted = [n for n in CASES if any(o.strip() in n for o in args.only.split(","))]
    with tempfile.TemporaryDirectory() as args.scratch:
        rows = [row for name in wanted if (row := compare(args, name))]
    print("| case | peer | ours, user s | peer, user s | ratio, user | ratio, wall | ours, MiB | peer, MiB | |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |")
    for r in rows:
        print(f"| {r['case']} | {r['peer']} | {r['ours']:.3f} | {r['theirs']:.3f} | {r['theirs'] / r['ours']:.1f} | "
              f"{r['wall']:.1f} | {r['ours_mib']:.0f} | {r['theirs_mib']:.0f} | {r['remark']} |")


if __name__ == "__main__":
    main()
