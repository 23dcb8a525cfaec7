"""Rooms and doorways of a 3D scene, and answers about them.

``bake`` finds the rooms (cells) and doorways (portals) of meshes by itself; the ``World`` that it returns answers what
is where, what is seen from where, and how to walk there:

>>> import enfilade
>>> world = enfilade.bake(vertices, faces)          # or a trimesh mesh or scene; bake("house.glb")
>>> world.locate([[1.0, 1.6, 2.0]])                 # cells of points, -1 in walls
>>> world.see(eye=(1, 1.6, 2), look=(4, 1.6, 2)).cells
>>> world.save("world.glb")                         # opens in any viewer of glTF

Units are meters, +y is up, as in glTF; ``unit`` and ``up`` tell how the input is. Arrays are numpy's. Long work runs
without Python's global lock, and an interrupt ends it.
"""

from ._bake import BakeWarning, Mesh, bake, bake_file, demo_house
from ._native import BakeError, EnfiladeError, NoPathError, SceneError, WorldError
from ._world import (
    Cell,
    Cells,
    IfcReport,
    Path,
    Place,
    Portal,
    Portals,
    Pvs,
    Room,
    Storey,
    Surface,
    View,
    Why,
    World,
    open,
)

__version__ = "0.1.0"

__all__ = [
    "BakeError",
    "BakeWarning",
    "Cell",
    "Cells",
    "EnfiladeError",
    "IfcReport",
    "Mesh",
    "NoPathError",
    "Path",
    "Place",
    "Portal",
    "Portals",
    "Pvs",
    "Room",
    "SceneError",
    "Storey",
    "Surface",
    "View",
    "Why",
    "World",
    "WorldError",
    "bake",
    "bake_file",
    "demo_house",
    "open",
]
