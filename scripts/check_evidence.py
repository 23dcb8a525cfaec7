#!/usr/bin/env python3
"""Checks evidence of visibility, from docs/evidence.md alone; needs nothing but Python's standard library.

    scripts/check_evidence.py (WORLD.glb | MAP.prt) EVIDENCE [--json]

Says what `enfilade verify --evidence` says: exit code 0 and the pairs that are proved, or 1 and the first claim that does not
hold. Two programs that share no line agree. It is a hundred times slower than the one in Rust.
"""
import json
import math
import re
import struct
import sys
import zlib

sys.setrecursionlimit(100_000)


class Refused(Exception):
    """The evidence is not accepted."""


def require(condition, problem):
    if not condition:
        raise Refused(problem)


# --- vectors -----------------------------------------------------------------------------------------------------------

def add(a, b): return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
def sub(a, b): return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
def mul(a, x): return (a[0] * x, a[1] * x, a[2] * x)
def neg(a): return (-a[0], -a[1], -a[2])
def dot(a, b): return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
def cross(a, b): return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
def length(a): return math.sqrt(dot(a, a))
def dist(a, b): return length(sub(a, b))
ZERO = (0.0, 0.0, 0.0)


def unit(a):
    n = length(a)
    return mul(a, 1.0 / n) if n > 1e-300 else ZERO


def least(n, points): return min(dot(n, p) for p in points)
def most(n, points): return max(dot(n, p) for p in points)


def sine(a, b):
    c = dot(a, b)
    return math.sqrt(max(0.0, 1.0 - c * c))


def newell(points):
    total = ZERO
    for k in range(1, len(points) - 1):
        total = add(total, cross(sub(points[k], points[0]), sub(points[k + 1], points[0])))
    return total


# --- what is read ------------------------------------------------------------------------------------------------------

def fnv(data):
    h = 0xCBF29CE484222325
    for byte in data:
        h = ((h ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return h


def read_prt(text):
    """Cells and portals of a Quake portal file: (cells, winding, pieces)."""
    lines = text.splitlines()
    magic = lines[0].strip()
    numbers = [int(line) for line in lines[1:6] if re.fullmatch(r"\s*\d+\s*", line)]
    n_cells = {"PRT1": 0, "PRT1-AM": 0, "PRT2": 1}[magic]
    n_portals = numbers[{"PRT1": 1, "PRT1-AM": 1, "PRT2": 2}[magic]]
    portals = []
    for line in [line for line in lines if "(" in line][:n_portals]:
        head = [int(word) for word in line.split("(")[0].split()]
        points = [tuple(float(x) for x in p.split()) for p in re.findall(r"\(([^)]*)\)", line)]
        require(len(points) == head[0], "a portal has other corners than it says")
        if len(points) >= 3:
            portals.append(((head[1], head[2]), points, []))
    return numbers[n_cells], portals, None


def read_world(data):
    """Cells, portals and triangles of a world; docs/format.md tells of the file."""
    size = struct.unpack_from("<I", data, 12)[0]
    root = json.loads(data[20:20 + size])
    binary = data[28 + size:]
    world = root["extensions"]["ENFILADE_cell_portal_graph"]

    def view(i):
        v = root["bufferViews"][i]
        start = v.get("byteOffset", 0)
        return v, binary[start:start + v["byteLength"]]

    portals = []
    if "portalCorners" in world:
        corners = list(struct.iter_unpack("<3f", view(world["portalCorners"])[1]))
        at = 0
        for portal in world["portals"]:
            polygons = []
            for n in [portal["outline"], *portal["pieces"]]:
                polygons.append(corners[at:at + n])
                at += n
            portals.append((tuple(portal["cells"]), polygons[0], polygons[1:]))

    def rows(i, kind, n):
        a = root["accessors"][i]
        v, data = view(a["bufferView"])
        row = struct.Struct("<" + kind * n)
        step = v.get("byteStride", row.size)
        at = a.get("byteOffset", 0)
        return [row.unpack_from(data, at + k * step) for k in range(a["count"])]

    triangles = []
    for batch in world["batches"]:
        if "mesh" not in batch:
            continue
        p = root["meshes"][batch["mesh"]]["primitives"][batch["primitive"]]
        points = rows(p["attributes"]["POSITION"], "f", 3)
        kind = {5121: "B", 5123: "H", 5125: "I"}[root["accessors"][p["indices"]]["componentType"]]
        ids = [i for (i,) in rows(p["indices"], kind, 1)]
        triangles += [tuple(points[i] for i in ids[k:k + 3]) for k in range(0, len(ids) - 2, 3)]
    return len(world["cells"]), portals, triangles


def graph_hash(n_cells, portals):
    out = bytearray(struct.pack("<II", n_cells, len(portals)))
    for cells, winding, pieces in portals:
        out += struct.pack("<II", *cells)
        for i, polygon in enumerate([winding, *pieces]):
            if i == 1:
                out += struct.pack("<I", len(pieces))
            out += struct.pack("<I", len(polygon))
            for p in polygon:
                out += struct.pack("<3d", *p)
        if not pieces:
            out += struct.pack("<I", 0)
    return fnv(out)


class Opening:
    def __init__(self, cells, normal, corners, pieces, turn):
        self.start, self.end = cells
        self.normal, self.corners, self.pieces, self.turn = normal, corners, pieces, turn
        self.low, self.high = least(normal, corners), most(normal, corners)


class Bytes:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, form):
        require(self.at + struct.calcsize(form) <= len(self.data), "it ends early")
        out = struct.unpack_from(form, self.data, self.at)
        self.at += struct.calcsize(form)
        return out

    def bytes(self, n):
        require(self.at + n <= len(self.data), "it ends early")
        self.at += n
        return self.data[self.at - n:self.at]


def bits(row):
    while row:
        low = row & -row
        yield low.bit_length() - 1
        row ^= low


# --- the checker -------------------------------------------------------------------------------------------------------

class Checker:
    def __init__(self, n_cells, portals, walls, evidence):
        self.n_cells, self.walls = n_cells, walls
        self.all, self.out = [], [[] for _ in range(n_cells)]
        self.scale = 1e-300
        for cells, winding, pieces in portals:
            for p in winding + [q for piece in pieces for q in piece]:
                self.scale = max(self.scale, *(abs(x) for x in p))
            total = newell(winding)
            reach = max(dot(sub(p, winding[0]), sub(p, winding[0])) for p in winding)
            normal = unit(total) if length(total) > 1e-12 * reach else ZERO
            for side in (0, 1):
                self.out[cells[side]].append(len(self.all))
                n = normal if side == 0 else neg(normal)
                order = cells if side == 0 else cells[::-1]
                self.all.append(Opening(order, n, winding, pieces or [winding], normal))
        self.rounding, self.hair = 1e-13 * self.scale, 1e-9 * self.scale
        self.read(evidence, graph_hash(n_cells, portals))

    def read(self, evidence, expected):
        require(evidence[:8] == b"ENFEVID4" and len(evidence) >= 24, "it does not begin with ENFEVID4")
        size, check = struct.unpack_from("<QQ", evidence, 8)
        require(check == fnv(evidence[24:]), "its check sum is wrong")
        unpacker = zlib.decompressobj()
        try:
            body = unpacker.decompress(evidence[24:], size + 1)
        except zlib.error as error:
            raise Refused(f"it cannot be unpacked: {error}") from error
        require(len(body) == size and unpacker.eof and not unpacker.unused_data, "it cannot be unpacked")
        data = Bytes(body)
        require(data.take("<Q")[0] == expected, "it is about another graph")
        self.c, self.far = data.take("<dd")
        require(0.0 <= self.c <= 1e-6 * self.scale, "its clearance is too wide")
        require(self.far >= 0.0, "its far plane is not a distance")
        self.said = data.take("<QQ")
        n = len(self.all)
        self.might, self.claims = (
            [int.from_bytes(data.bytes((n + 7) // 8), "little") for _ in range(n)] for _ in range(2)
        )
        require(all(row >> n == 0 for row in self.might + self.claims), "a table has bits beyond its rows")
        self.lines, self.trees = [], []
        for _ in range(data.take("<Q")[0]):
            x = data.take("<6d")
            chain = data.take(f"<{data.take('<I')[0]}I")
            require(all(d < n for d in chain), "a line contains an opening that is not in the graph")
            self.lines.append((x[:3], x[3:], chain))
        for _ in range(data.take("<Q")[0]):
            s, t, size = data.take("<III")
            require(s < n and t < n, "a tree contains an opening that is not in the graph")
            self.trees.append((s, t, data.bytes(size)))
        self.trace = data.data[data.at:]

    def check(self):
        for s, t, tree in self.trees:
            Trees(self, s, t, tree).check()
        self.check_reasons()
        self.check_traces()
        proved = [1 << c for c in range(self.n_cells)]
        for line in self.lines:
            self.check_line(*line)
            chain = line[2]
            for i, first in enumerate(chain):
                for last in chain[i:]:
                    a, b = self.all[first].start, self.all[last].end
                    proved[a] |= 1 << b
                    proved[b] |= 1 << a
        visible = [1 << c for c in range(self.n_cells)]
        for s, opening in enumerate(self.all):
            visible[opening.start] |= 1 << opening.end
            for t in bits(self.might[s]):
                visible[opening.start] |= 1 << self.all[t].end
        require(all(p & ~v == 0 for p, v in zip(proved, visible)), "a line shows a cell that is claimed hidden")
        n_visible, n_proved = (sum(row.bit_count() for row in table) for table in (visible, proved))
        require(self.said == (n_visible, n_proved), "its totals are not those of its tables")
        return {
            "visible_pairs": n_visible,
            "proved_pairs": n_proved,
            "undecided_pairs": n_visible - n_proved,
            "hidden_pairs": self.n_cells ** 2 - n_visible,
            "walled_openings": len(self.trees),
            "lines": len(self.lines),
            "trace_bytes": len(self.trace),
            "clearance": self.c,
            "far": None if math.isinf(self.far) else self.far,
        }

    # Why hidden is hidden

    def check_reasons(self):
        walled = {(s, t) for s, t, _ in self.trees}
        walled |= {(t ^ 1, s ^ 1) for s, t in walled}
        may = lambda s, t: self.might[s] >> t & 1
        for s, opening in enumerate(self.all):
            require(self.claims[s] & self.might[s] == 0, f"{s}: claimed hidden and not hidden")
            for t in bits(self.might[s]):
                require(may(t ^ 1, s ^ 1), f"{s}, {t}: hidden one way, not the other")
            after = 0
            for q in self.out[opening.end]:
                if q != s ^ 1:
                    after |= 1 << q
                    if may(s, q):
                        after |= self.might[q]
            # What no next opening might see is hidden by its neighbors.
            for t in bits(after & ~self.might[s]):
                target = self.all[t]
                reasons = (
                    t in (s, s ^ 1)
                    or self.claims[s] >> t & 1
                    or self.claims[t ^ 1] >> (s ^ 1) & 1
                    or (s, t) in walled
                    or self.are_apart(s, t)
                    or target.start != opening.end
                    and not any(
                        may(s, e ^ 1) and may(e ^ 1, t) for e in self.out[target.start] if e != t
                    )
                )
                require(reasons, f"{s}, {t}: no reason shows that they are hidden")

    def are_apart(self, s, t):
        a, b = self.all[s], self.all[t]
        thin = self.c * sine(a.normal, b.normal) + self.rounding
        if a.normal != ZERO and most(a.normal, b.corners) - a.low <= thin:
            return True
        if b.normal != ZERO and b.high - least(b.normal, a.corners) <= thin:
            return True
        (p, r), (q, u) = ball(a.corners), ball(b.corners)
        return dist(p, q) - r - u > self.far

    # Lines

    def check_line(self, origin, direction, chain):
        require(all(map(math.isfinite, origin + direction)), "a line has no direction")
        require(chain, "a line crosses nothing")
        times = []
        for d in chain:
            o = self.all[d]
            speed = dot(o.normal, direction)
            require(speed > 5e-10 * length(direction), "a line does not cross an opening from front to back")
            t = ((o.low + o.high) * 0.5 - dot(o.normal, origin)) / speed
            p = add(origin, mul(direction, t))
            require(any(self.is_inside(o, piece, p) for piece in o.pieces), "a line misses an opening")
            if times:
                require(self.all[before].end == o.start, "openings of a line do not follow each other")
                require(t >= times[-1], "a line crosses openings in another order")
                q = add(origin, mul(direction, times[-1]))
                require(not self.is_blocked(q, p), "something solid is in a line's way")
            times.append(t)
            before = d
        require((times[-1] - times[0]) * length(direction) <= self.far, "a line is longer than the far plane allows")

    def is_inside(self, o, piece, p):
        for k, a in enumerate(piece):
            inward = unit(cross(o.turn, sub(piece[(k + 1) % len(piece)], a)))
            if dot(inward, sub(p, a)) < self.rounding:
                return False
        return True

    def is_blocked(self, p, q):
        if not self.walls:
            return False
        low = [min(a, b) for a, b in zip(p, q)]
        high = [max(a, b) for a, b in zip(p, q)]
        d = sub(q, p)
        for (a, b, c), tl, th in self.boxed_walls():
            if tl[0] > high[0] or th[0] < low[0] or tl[1] > high[1] or th[1] < low[1] or tl[2] > high[2] or th[2] < low[2]:
                continue
            e, f = sub(b, a), sub(c, a)
            n = cross(e, f)
            fall = -dot(n, d)
            if fall == 0.0:
                continue
            t = dot(n, sub(p, a)) / fall
            if not 0.0 < t < 1.0:
                continue
            x = add(p, mul(d, t))
            sides = [dot(n, cross(sub(v, u), sub(x, u))) for u, v in ((a, b), (b, c), (c, a))]
            if min(sides) > 0.0:
                return True
        return False

    def boxed_walls(self):
        if not hasattr(self, "boxes"):
            self.boxes = [
                (t, [min(p[k] for p in t) for k in range(3)], [max(p[k] for p in t) for k in range(3)])
                for t in self.walls
            ]
        return self.boxes

    # Planes. A part of an opening is (direction, corners); None where nothing is left.

    def keep(self, part, normal, offset, clearance):
        d, corners = part
        heights = [dot(normal, p) - offset for p in corners]
        if min(heights) >= -self.hair:
            return part
        if self.is_out(d, normal, max(heights), clearance):
            return None
        out = []
        for k, p in enumerate(corners):
            j = (k + 1) % len(corners)
            h, g, q = heights[k] + self.hair, heights[j] + self.hair, corners[j]
            if h >= 0.0:
                out.append(p)
            if h > 0.0 > g:
                out.append(add(p, mul(sub(q, p), h / (h - g))))
            elif h < 0.0 < g:
                out.append(add(q, mul(sub(p, q), g / (g - h))))
        return (d, out)

    def is_out(self, d, normal, high, clearance):
        # A thousandth more than claimed, as two programs round.
        wide = 1.001 * clearance
        return high < -self.hair or (high < wide and high < wide * sine(normal, self.all[d].normal))

    def in_front(self, part, plane):
        return part and self.keep(part, plane[0], plane[2], self.c)

    def behind(self, part, plane):
        return part and self.keep(part, neg(plane[0]), -plane[1], self.c)

    def plane_of(self, d):
        o = self.all[d]
        return (o.normal, o.high, o.low)

    def hides(self, plane, d):
        return self.is_out(d, plane[0], most(plane[0], self.all[d].corners) - plane[2], self.c)

    def between(self, first, second):
        """Planes (normal, a, b): all of the first has n·p <= a, all of the second n·p >= b, and a <= b."""
        planes = []
        for own, other, sign in ((first, second, 1.0), (second, first, -1.0)):
            opening, corners = self.all[own[0]], own[1]
            ahead = mul(opening.normal, sign)
            for k, p in enumerate(corners):
                edge = sub(corners[(k + 1) % len(corners)], p)
                inward = cross(opening.turn, edge)
                edge2 = dot(edge, edge)
                best = None
                for q in other[1]:
                    v = sub(q, p)
                    x, y = dot(inward, v), max(0.0, dot(ahead, v))
                    # Vertices on the edge's line lie in all such planes.
                    if x * x + y * y * edge2 <= (1e-11 * self.scale) ** 2 * edge2:
                        continue
                    if best is None or x * best[1] - y * best[0] > 0.0:
                        best = (x, y, v)
                if best is None or best[1] <= self.rounding:
                    continue
                normal = cross(edge, best[2])
                if length(normal) <= self.rounding ** 2:
                    continue
                normal = unit(normal)
                if dot(normal, inward) * sign > 0.0:
                    normal = neg(normal)
                a, b = most(normal, first[1]), least(normal, second[1])
                if a <= b + self.rounding:
                    planes.append((normal, a, b))
        return planes

    # Traces

    def check_traces(self):
        data = Bytes(self.trace)
        for s, opening in enumerate(self.all):
            if self.claims[s]:
                whole = (s, opening.corners)
                Walk(self, data, s).step([whole], whole, (1 << len(self.all)) - 1)
        require(data.at == len(data.data), "there is more trace than openings")


def ball(points):
    center = ZERO
    for p in points:
        center = add(center, p)
    center = mul(center, 1.0 / len(points))
    return center, max(dist(p, center) for p in points)


class Walk:
    """The trace of one source. A chain is a list of parts, its source first as it was; None is a part that planes closed."""

    def __init__(self, checker, data, start):
        self.k, self.data, self.start = checker, data, start
        self.claims = checker.claims[start]

    def fail(self, problem):
        raise Refused(f"the trace of {self.start}, byte {self.data.at}: {problem}")

    def symbol(self):
        return self.data.take("<B")[0]

    def step(self, chain, source, reach, dirs=None):
        k = self.k
        dirs = dirs or [self.start]
        last, passed = dirs[-1], chain[-1]
        planes = []
        if source and passed and len(dirs) > 1:
            planes = k.between(source, passed)
            if len(dirs) == 2:
                reach &= self.flood(dirs[1], planes, reach)
            else:
                for q in bits(reach & self.claims):
                    if any(k.hides(plane, q) for plane in planes):
                        reach &= ~(1 << q)
        closed = source is None or passed is None
        symbol = self.symbol()
        if symbol == 5:
            if not closed and reach & self.claims:
                self.fail("it stops before it shows everything")
            return
        if symbol != 4:
            self.fail("a step begins with an unknown symbol")
        for q in k.out[k.all[last].end]:
            symbol = self.symbol()
            behind = reach & k.might[q]
            in_reach = reach >> q & 1
            claimed = in_reach and self.claims >> q & 1
            if symbol == 0:
                leads_on = k.might[self.start] >> q & 1 and behind & self.claims
                if not (closed or q == last ^ 1 or not in_reach or not (leads_on or claimed)):
                    self.fail("it skips an exit that matters")
                continue
            if q == last ^ 1:
                self.fail("it goes back through an opening")
            left, target = self.narrow(source, passed, q, planes, len(dirs)) if not closed else (None, None)
            grown = [*chain, target]
            if symbol == 1:
                if target and left and not self.closes(grown, left, 5):
                    self.fail("planes do not close this chain")
            elif symbol == 2:
                if claimed and target:
                    self.fail("it sees an opening that it claims hidden")
                self.step(grown, left, behind, [*dirs, q])
            elif symbol == 3:
                self.split(grown, left)
            elif symbol == 8:
                self.unstabbed([*dirs, q])
            else:
                self.fail("an exit has an unknown symbol")

    def narrow(self, source, passed, q, planes, depth):
        k = self.k
        target = k.in_front((q, k.all[q].corners), k.plane_of(source[0]))
        if passed[0] != source[0]:
            target = k.in_front(target, k.plane_of(passed[0]))
        for plane in planes:
            target = k.in_front(target, plane)
        left = k.behind(source, k.plane_of(q))
        if depth > 1 and target:
            for plane in k.between(passed, target):
                left = k.behind(left, plane)
        return (left, target) if left and target else (None, None)

    def flood(self, first, planes, reach):
        k = self.k
        reached, stack = 0, [first]
        passable = k.might[self.start]
        while stack:
            at = stack.pop()
            for q in k.out[k.all[at].end]:
                bit = 1 << q
                if (
                    q != at ^ 1
                    and reach & bit
                    and not reached & bit
                    and k.might[at] & bit
                    and (passable | self.claims) & bit
                    and not any(k.hides(plane, q) for plane in planes)
                ):
                    reached |= bit
                    if passable & bit:
                        stack.append(q)
        return reached

    def split(self, chain, source):
        tight = self.tighten(chain, source)
        symbol = self.symbol()
        if symbol == 6:
            if tight and not self.closes(*tight, 5):
                self.fail("planes do not close this piece")
        elif symbol == 7:
            chain, halves = (tight[0], self.halves(tight[1])) if tight else (chain, (None, None))
            for half in halves:
                self.split(chain, half)
        else:
            self.fail("a split has an unknown symbol")

    def closes(self, chain, source, tries):
        tight = self.tighten(chain, source)
        if tight is None:
            return True
        if tries == 0:
            return False
        return all(half is None or self.closes(tight[0], half, tries - 1) for half in self.halves(tight[1]))

    def tighten(self, chain, source):
        """The chain clipped between the source and itself, and the source after that; None when nothing is left."""
        k = self.k
        if source is None or any(part is None for part in chain[1:]):
            return None
        planes, tight = [], [chain[0]]
        for part in chain[1:]:
            for plane in planes:
                part = k.in_front(part, plane)
            if part is None:
                return None
            planes += k.between(source, part)
            tight.append(part)
        for part in tight[1:-1]:
            for plane in k.between(part, tight[-1]):
                source = k.behind(source, plane)
        return source and (tight, source)

    def halves(self, part):
        axis, middle = longest(part[1])
        return [self.k.keep(part, mul(axis, sign), middle * sign, 0.0) for sign in (1.0, -1.0)]

    def unstabbed(self, dirs):
        k = self.k
        weights = [self.data.take("<Hd") for _ in range(self.symbol())]
        points = [p for d in dirs for p in k.all[d].corners]
        middle = ZERO
        for p in points:
            middle = add(middle, mul(p, 1.0 / len(points)))
        reach = max(1e-300, max(abs(x) for p in points for x in sub(p, middle)))
        rows = []
        for d in dirs:
            o = k.all[d]
            if o.normal == ZERO:
                self.fail("an opening without area has no rows")
            sign = 1.0 if d % 2 == 0 else -1.0
            for i, p in enumerate(o.corners):
                a, b = (mul(sub(x, middle), 1.0 / reach) for x in (p, o.corners[(i + 1) % len(o.corners)]))
                row = [sign * x for x in cross(a, b) + sub(b, a)]
                size = math.sqrt(sum(x * x for x in row))
                rows.append([x / size for x in row] if size else None)
            rows.append([*o.normal, 0.0, 0.0, 0.0])
        total, balance = 0.0, [0.0] * 6
        for i, weight in weights:
            if i >= len(rows) or rows[i] is None or not weight >= 0.0:
                self.fail("its weights are of no rows, or below zero")
            total += weight
            balance = [b + weight * x for b, x in zip(balance, rows[i])]
        if not (abs(total - 1.0) <= 1e-9 and math.sqrt(sum(b * b for b in balance)) <= 1e-13):
            self.fail("its weights do not show that no line passes this chain")


def longest(points):
    low = [min(p[k] for p in points) for k in range(3)]
    high = [max(p[k] for p in points) for k in range(3)]
    size = [h - l for h, l in zip(high, low)]
    k = 0 if size[0] >= size[1] and size[0] >= size[2] else 1 if size[1] >= size[2] else 2
    axis = [ZERO] * 3
    axis = tuple(1.0 if i == k else 0.0 for i in range(3))
    return axis, (low[k] + high[k]) * 0.5


# --- trees -------------------------------------------------------------------------------------------------------------

def kept(polygon, normal, limit):
    out = []
    for k, p in enumerate(polygon):
        q = polygon[(k + 1) % len(polygon)]
        h, g = dot(normal, p) - limit, dot(normal, q) - limit
        if h >= 0.0:
            out.append(p)
        if h > 0.0 > g:
            out.append(add(p, mul(sub(q, p), h / (h - g))))
        elif h < 0.0 < g:
            out.append(add(q, mul(sub(p, q), g / (g - h))))
    return out if len(out) >= 3 else []


class Trees:
    """Walls between two openings."""

    def __init__(self, checker, s, t, tree):
        self.k, self.s, self.t, self.data = checker, s, t, Bytes(tree)
        # Nearer than this is touching.
        self.apart = 8e-13 * checker.scale

    def fail(self, problem):
        raise Refused(f"the tree from {self.s} to {self.t}: {problem}")

    def parts(self, d):
        o = self.k.all[d]
        middle = (o.low + o.high) * 0.5
        for piece in o.pieces:
            part = [add(p, mul(o.normal, middle - dot(o.normal, p))) for p in piece]
            for i, p in enumerate(piece):
                inward = unit(cross(o.turn, sub(piece[(i + 1) % len(piece)], p)))
                part = kept(part, inward, dot(inward, p) + self.k.c)
            yield part

    def check(self):
        a, b = self.k.all[self.s], self.k.all[self.t]
        for first in self.parts(self.s):
            for second in self.parts(self.t):
                second_kept = kept(second, a.normal, (a.low + a.high) * 0.5)
                first_kept = kept(first, neg(b.normal), -(b.low + b.high) * 0.5)
                if first_kept and second_kept:
                    self.node(first_kept, second_kept)
        require(self.data.at == len(self.data.data), "there is more of a tree than pieces")

    def node(self, first, second):
        symbol = self.data.take("<B")[0]
        if symbol == 0:
            for half in self.halves(first):
                self.node(half, second)
        elif symbol == 1:
            for half in self.halves(second):
                self.node(first, half)
        elif symbol == 2:
            ids = self.data.take(f"<{self.data.take('<B')[0]}I")
            if not self.k.walls or any(i >= len(self.k.walls) for i in ids):
                self.fail("it contains a triangle that is not in the world")
            if first and second:
                self.sheet([self.k.walls[i] for i in ids], first, second)
        else:
            self.fail("it has an unknown symbol")

    @staticmethod
    def halves(polygon):
        if not polygon:
            return [], []
        axis, middle = longest(polygon)
        return kept(polygon, axis, middle), kept(polygon, neg(axis), -middle)

    def sheet(self, sheet, first, second):
        rim = {}
        for t in sheet:
            for u, v in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])):
                # Adding zero makes one of the two zeros.
                key = frozenset((add(u, ZERO), add(v, ZERO)))
                rim[key] = (rim.get(key, (0,))[0] + 1, u, v)
        sides = self.hull(first, second)
        for count, u, v in rim.values():
            if count % 2 and not self.is_off(u, v, sides):
                self.fail("a line may pass around the triangles")
        p, q = self.inner(first), self.inner(second)
        odd = False
        for t in sheet:
            if self.touch(t, first) or self.touch(t, second):
                self.fail("a triangle touches an opening")
            odd ^= self.crosses(t, p, q)
        if not odd:
            self.fail("a line passes through the triangles unblocked")

    @staticmethod
    def inner(polygon):
        total, weights = ZERO, 0.0
        for i, p in enumerate(polygon):
            # Off the middle, where walls are often cut into triangles.
            w = 1.0 + 0.17 * (i % 4)
            total, weights = add(total, mul(p, w)), weights + w
        return mul(total, 1.0 / weights)

    def hull(self, first, second):
        points, sides = first + second, []

        def side(n):
            if n != ZERO:
                sides.append((n, least(n, points)))

        for own, other in ((first, second), (second, first)):
            turn = unit(newell(own))
            side(turn)
            side(neg(turn))
            for i, p in enumerate(own):
                edge = sub(own[(i + 1) % len(own)], p)
                for corner in other:
                    n = unit(cross(edge, sub(corner, p)))
                    # Others cut through the polygons, and bound nothing tightly; any half-space may be used.
                    if least(n, points) - dot(n, p) >= -4.0 * self.apart:
                        side(n)
                    if most(n, points) - dot(n, p) <= 4.0 * self.apart:
                        side(neg(n))
        return sides

    def is_off(self, u, v, sides):
        low, high = 0.0, 1.0
        for n, limit in sides:
            h, g = dot(n, u) - limit + self.apart, dot(n, v) - limit + self.apart
            if max(h, g) < 0.0:
                return True
            if h < 0.0:
                low = max(low, h / (h - g))
            if g < 0.0:
                high = min(high, h / (h - g))
        return low > high

    def touch(self, t, polygon):
        turn = unit(newell(polygon))
        edges = [sub(t[(i + 1) % 3], t[i]) for i in range(3)]
        axes = [turn, cross(edges[0], edges[1])]
        for i, p in enumerate(polygon):
            edge = sub(polygon[(i + 1) % len(polygon)], p)
            axes.append(cross(turn, edge))
            axes += [cross(e, edge) for e in edges]
        for axis in axes:
            n = unit(axis)
            if most(n, t) + self.apart < least(n, polygon) or most(n, polygon) + self.apart < least(n, t):
                return False
        return True

    def crosses(self, t, p, q):
        n = unit(cross(sub(t[1], t[0]), sub(t[2], t[0])))
        above, below = dot(n, sub(p, t[0])), dot(n, sub(q, t[0]))
        if min(above, below) > self.apart or max(above, below) < -self.apart:
            return False
        if abs(above - below) <= 5e-5 * dist(p, q):
            self.fail("a line passes too near to an edge to tell")
        x = add(p, mul(sub(q, p), above / (above - below)))
        near = 1e-8 * self.k.scale
        inside = [dot(unit(cross(n, sub(t[(i + 1) % 3], t[i]))), sub(x, t[i])) for i in range(3)]
        if min(inside) < -near:
            return False
        if min(inside) <= near or min(abs(above), abs(below)) <= self.apart:
            self.fail("a line passes too near to an edge to tell")
        return True


def main():
    names = [a for a in sys.argv[1:] if not a.startswith("-")]
    if len(names) != 2:
        sys.exit(__doc__)
    with open(names[0], "rb") as file:
        data = file.read()
    with open(names[1], "rb") as file:
        evidence = file.read()
    graph = read_world(data) if data[:4] == b"glTF" else read_prt(data.decode("utf-8", "replace"))
    try:
        report = Checker(*graph, evidence).check()
    except (Refused, RecursionError) as problem:
        sys.exit(f"{names[1]} is not accepted: {problem}")
    if "--json" in sys.argv:
        print(json.dumps(report))
    else:
        print(
            f"every claim holds: {report['proved_pairs']} pairs proved visible by {report['lines']} lines, "
            f"{report['hidden_pairs']} proved hidden, {report['undecided_pairs']} undecided and called visible"
        )


main()
