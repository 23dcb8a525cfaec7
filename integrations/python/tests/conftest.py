"""The command `enfilade` in $ENFILADE, and worlds in $ENFILADE_WORLDS (demo first), with which answers are compared."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import enfilade


class Command:
    def __init__(self, program):
        self.program = program

    def __call__(self, *args, stdin=""):
        done = subprocess.run(
            [self.program, *map(str, args)], input=stdin, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def json(self, *args, stdin=""):
        return json.loads(self(*args, "--json", stdin=stdin))

    def refusal(self, *args):
        done = subprocess.run([self.program, *map(str, args)], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        return done.stderr


@pytest.fixture(scope="session")
def command():
    program = os.environ.get("ENFILADE")
    if not program:
        pytest.skip("$ENFILADE, the command to compare with, is not set")
    return Command(program)


@pytest.fixture(scope="session")
def worlds():
    """Paths of baked worlds: the demo's, and of real buildings if there are any."""
    paths = [Path(p) for p in os.environ.get("ENFILADE_WORLDS", "").split(os.pathsep) if p]
    if not paths:
        pytest.skip("$ENFILADE_WORLDS, worlds to compare answers on, is not set")
    return paths


@pytest.fixture(scope="session")
def world():
    # Nothing is said of a world without doubts: warnings are errors here.
    return enfilade.bake(enfilade.demo_house())


def box(low, high):
    """Returns the six sides of a box seen from inside."""
    x, y, z = zip(low, high)
    corners = np.array([[a, b, c] for a in x for b in y for c in z], dtype=np.float64)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners, np.array(faces, dtype=np.int64)


def two_rooms():
    """Returns a box of 9 × 3 × 5 m with a wall at x = 5, and in it a doorway of 0.9 × 2.1 m, as one mesh."""
    vertices, faces = box((0, 0, 0), (9, 3, 5))
    parts, quads = [vertices], [faces]
    for z0, z1, y0, y1 in ((0, 2, 0, 3), (2.9, 5, 0, 3), (2, 2.9, 2.1, 3)):
        n = sum(map(len, parts))
        parts.append(np.array([[5, y0, z0], [5, y0, z1], [5, y1, z1], [5, y1, z0]], dtype=np.float64))
        quads.append(np.array([[n, n + 1, n + 2], [n, n + 2, n + 3]]))
    return np.concatenate(parts), np.concatenate(quads)
