"""Bakes: scenes in, worlds out."""

import json
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

import numpy as np

from . import _arrays, _native
from ._world import World

Settings = Union["Mapping[str, Any]", str, "os.PathLike[str]"]
Progress = Callable[[str, int, int], object]


class BakeWarning(UserWarning):
    """A doubt about a scene, or about a world made of it."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh for ``bake``. Those of other packages, with the same attributes, serve as well."""

    vertices: Any
    """(n, 3) floats."""
    faces: Any
    """(m, 3) integers: the numbers of three vertices, counter-clockwise seen from the front."""
    name: str = ""
    """Tells doors, windows and furniture from walls, and is kept."""
    detail: bool = False
    """True if it bounds no room, whatever its name."""


def demo_house() -> List[Mesh]:
    """Returns a furnished house of two storeys and an attic, in meters with y up: something to try ``bake`` on."""
    return [Mesh(v, f, name, detail) for name, v, f, detail in _native.demo_meshes()]


def bake(
    vertices: Any,
    faces: Any = None,
    *,
    detail: Any = None,
    unit: Union[None, str, float] = None,
    up: Optional[str] = None,
    min_opening: Optional[float] = None,
    smallest_hole: Optional[float] = None,
    voxel: Optional[float] = None,
    detail_names: Sequence[str] = (),
    structural_names: Sequence[str] = (),
    method: str = "auto",
    settings: Optional[Settings] = None,
    threads: Optional[int] = None,
    max_memory: Optional[int] = None,
    max_time: Optional[float] = None,
    allow_empty: bool = False,
    progress: Optional[Progress] = None,
) -> World:
    """Finds the rooms and doorways of meshes, or of a file.

    ``bake("house.glb")`` is ``bake_file``, which has options for files; ``detail`` then names files, too.
    ``bake(vertices, faces)`` takes arrays: (n, 3) floats, and (m, 3) integers that number vertices from 0.
    ``bake(mesh)`` takes what has ``vertices`` and ``faces`` or ``triangles``, as meshes of trimesh and open3d do; a ``trimesh.Scene``; a mapping of
    names to meshes; or a list of meshes. Names tell doors, windows and furniture from walls, and are kept; meshes
    without names, and one mesh of all, are judged by shape. Colors and pictures are left out: ``bake_file`` keeps them.

    Equal input gives an equal world, on any number of threads.

    detail: meshes that bound no room, whatever their names: furniture, door leaves.
    unit: the unit of the coordinates: ``"m"`` (the default), ``"cm"``, ``"mm"``, ``"in"``, ``"ft"``, or its meters.
    up: the axis that points up, ``"y"`` (the default) or ``"z"``; z up becomes y up, (x, y, z) as (x, z, -y).
    min_opening: the width in meters of the narrowest opening that must be found; 0.6 by default.
    smallest_hole: the width in meters below which openings are gaps of the model, 0.01 by default; 0 keeps all.
    voxel: the edge of a voxel in meters; chosen by itself if not given.
    detail_names, structural_names: patterns (``*``, ``?``) of names of furniture, and of walls.
    method: ``"auto"``, ``"watershed"``, ``"bsp"`` or ``"delaunay"``.
    settings: a mapping with the names of ``docs/settings.md``, or the path of such a file; arguments take precedence.
    threads: the number of threads; one per core by default.
    max_memory, max_time: limits in bytes and seconds, beyond which a bake ends with an error.
    allow_empty: return a world without rooms rather than raise ``BakeError``.
    progress: called as ``progress(stage, number, count)`` in this thread when a stage begins; may raise to end the bake.

    Raises ``ValueError`` for wrong arguments, with the row; ``SceneError`` if the unit or the axis are plainly wrong;
    ``BakeError`` if no room is found or a limit is reached. Doubts are warnings, ``BakeWarning``. Options in their texts
    are the arguments above. An interrupt ends the bake within about a second.
    """
    options = _options(
        settings,
        method,
        threads,
        max_memory,
        max_time,
        allow_empty,
        False,
        False,
        unit=unit,
        up=up,
        min_opening=min_opening,
        smallest_hole=smallest_hole,
        voxel=voxel,
        detail_names=detail_names,
        structural_names=structural_names,
    )
    if faces is None and _is_path(vertices):
        return _told(_native.bake_files, _paths(vertices), _paths(detail or ()), options, progress)
    meshes: List[Tuple[Any, ...]] = []
    if faces is not None:
        meshes.append(_placed("", "", vertices, faces, None, False))
    else:
        _add(meshes, vertices, False, "vertices")
    if detail is not None:
        _add(meshes, detail, True, "detail")
    return _told(_native.bake_arrays, meshes, options, progress)


def bake_file(
    files: Any,
    *,
    detail: Any = (),
    unit: Union[None, str, float] = None,
    up: Optional[str] = None,
    min_opening: Optional[float] = None,
    smallest_hole: Optional[float] = None,
    voxel: Optional[float] = None,
    detail_names: Sequence[str] = (),
    structural_names: Sequence[str] = (),
    scene: Union[None, str, int] = None,
    method: str = "auto",
    settings: Optional[Settings] = None,
    threads: Optional[int] = None,
    max_memory: Optional[int] = None,
    max_time: Optional[float] = None,
    allow_empty: bool = False,
    allow_leak: bool = False,
    allow_outside: bool = False,
    progress: Optional[Progress] = None,
) -> World:
    """Finds the rooms and doorways of a scene in files, as ``enfilade bake`` does.

    files: a path, or several that make one scene: GLB, glTF, OBJ, PLY, STL, gbXML, HBJSON, Quake ``.map``, or IFC, which needs the
    package ifcopenshell.
    detail: files whose objects bound no room.
    scene: the scene to read of a glTF file with several, by its name or its number from 0; its default scene if not given.
    allow_leak: go on with a map whose inside is open to the void, rather than raise ``BakeError``.
    allow_outside: also read files outside the scene's folder that it refers to; unsafe for scenes from strangers.

    All other arguments, exceptions and warnings are those of ``bake``; a missing file is ``FileNotFoundError``.
    """
    options = _options(
        settings,
        method,
        threads,
        max_memory,
        max_time,
        allow_empty,
        allow_leak,
        allow_outside,
        unit=unit,
        up=up,
        min_opening=min_opening,
        smallest_hole=smallest_hole,
        voxel=voxel,
        detail_names=detail_names,
        structural_names=structural_names,
        scene=None if scene is None else str(scene),
    )
    return _told(_native.bake_files, _paths(files), _paths(detail), options, progress)


def _told(function: Callable[..., Any], *args: Any) -> World:
    """Calls a native function, and says its warnings and errors with the names of arguments."""
    try:
        world, said = function(*args)
    except _native.EnfiladeError as error:
        raise type(error)(_in_python(str(error))) from None
    for text in said:
        warnings.warn(_in_python(text), BakeWarning, stacklevel=3)
    return World(world)


_ARGUMENTS = {
    "unit": "unit",
    "up": "up",
    "min-opening": "min_opening",
    "smallest-hole": "smallest_hole",
    "voxel": "voxel",
    "detail-name": "detail_names",
    "structural-name": "structural_names",
    "scene": "scene",
    "max-memory": "max_memory",
    "max-time": "max_time",
    "allow-empty": "allow_empty",
    "allow-leak": "allow_leak",
}


def _in_python(text: str) -> str:
    """Returns a text of the command with its options as arguments: ``--up z`` as ``up='z'``."""

    def argument(match: "re.Match[str]") -> str:
        name, value = _ARGUMENTS[match[1]], match[2]
        if name.startswith("allow_"):
            return f"{name}=True" + (f" {value}" if value else "")
        if value is None:
            return name
        if name.endswith("_names"):
            return f"{name}=[{value}]"
        is_word = re.fullmatch(r"[a-z]+", value) is not None
        return f"{name}={value!r}" if is_word else f"{name}={value}"

    names = "|".join(_ARGUMENTS)
    values = r"'PATTERN'|UNIT|WIDTH|[xyz]\b|(?:mm|cm|m|in|ft)\b|\d+(?:\.\d+)?"
    return re.sub(rf"--({names})(?: ({values}))?", argument, text)


def _options(
    settings: Optional[Settings],
    method: str,
    threads: Optional[int],
    max_memory: Optional[int],
    max_time: Optional[float],
    allow_empty: bool,
    allow_leak: bool,
    allow_outside: bool,
    **arguments: Any,
) -> Dict[str, Any]:
    toml = text = None
    if isinstance(settings, Mapping):
        text = json.dumps(dict(settings), default=_plain)
    elif settings is not None:
        with open(settings, encoding="utf-8") as file:
            toml = file.read()
    given = {k: v for k, v in arguments.items() if v is not None}
    for name in ("detail_names", "structural_names"):
        names = given[name]
        given[name] = [names] if isinstance(names, str) else list(names)
    return {
        "toml": toml,
        "json": text,
        "arguments": json.dumps(given, default=_plain),
        "method": method,
        "threads": threads,
        "max_memory": max_memory,
        "max_time": max_time,
        "allow_empty": allow_empty,
        "allow_leak": allow_leak,
        "allow_outside": allow_outside,
    }


def _plain(value: Any) -> Any:
    """Returns numbers and arrays of numpy as those of JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"settings hold numbers, texts and lists, not {type(value).__name__}")


def _is_path(given: Any) -> bool:
    """True for a path, and for several that make one scene."""
    paths = given if isinstance(given, (list, tuple)) and given else [given]
    return all(isinstance(path, (str, os.PathLike)) for path in paths)


def _paths(files: Any) -> List[str]:
    if isinstance(files, (str, os.PathLike)):
        files = [files]
    return [os.fspath(path) for path in files]


def _placed(name: str, shape: str, vertices: Any, faces: Any, transform: Any, detail: bool) -> Tuple[Any, ...]:
    label = name or shape
    of = f"mesh {label!r}: " if label else ""
    rows = None
    if transform is not None:
        matrix = np.asarray(transform, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError(f"{of}transform: expected four rows of four finite numbers")
        rows = matrix.tolist()
    array = _arrays.points(f"{of}vertices", vertices)
    return ([name, shape], array, _arrays.faces(f"{of}faces", faces), rows, detail)


def _add(meshes: List[Tuple[Any, ...]], given: Any, detail: bool, argument: str) -> None:
    """Adds a mesh, a scene, or several."""
    if hasattr(given, "geometry") and hasattr(given, "graph"):
        _add_scene(meshes, given, detail)
    elif _is_mesh(given):
        metadata = getattr(given, "metadata", None)
        name = metadata.get("name") if isinstance(metadata, Mapping) else getattr(given, "name", None)
        detail = detail or getattr(given, "detail", False) is True
        meshes.append(_placed(str(name or ""), "", *_pair(given, argument), None, detail))
    elif isinstance(given, Mapping):
        for name, mesh in given.items():
            vertices, faces = _pair(mesh, f"{argument}[{name!r}]")
            meshes.append(_placed(str(name), "", vertices, faces, None, detail))
    elif isinstance(given, (list, tuple)) and all(_is_mesh(m) or hasattr(m, "graph") for m in given):
        for mesh in given:
            _add(meshes, mesh, detail, argument)
    elif isinstance(given, (list, tuple)) and len(given) == 2 and argument == "detail":
        meshes.append(_placed("", "", given[0], given[1], None, detail))
    else:
        raise TypeError(
            f"{argument}: expected a mesh with vertices and faces, a scene, or several meshes, not "
            f"{type(given).__name__}; arrays are given as bake(vertices, faces)"
        )


def _is_mesh(given: Any) -> bool:
    return hasattr(given, "vertices") and (hasattr(given, "faces") or hasattr(given, "triangles"))


def _pair(mesh: Any, name: str) -> Tuple[Any, Any]:
    """Returns the vertices and faces of a mesh; open3d calls them triangles."""
    if _is_mesh(mesh):
        return mesh.vertices, mesh.faces if hasattr(mesh, "faces") else mesh.triangles
    if isinstance(mesh, (list, tuple)) and len(mesh) == 2:
        return mesh[0], mesh[1]
    raise TypeError(f"{name}: expected a mesh, or a pair of vertices and faces, not {type(mesh).__name__}")


def _add_scene(meshes: List[Tuple[Any, ...]], scene: Any, detail: bool) -> None:
    """Adds the meshes of a ``trimesh.Scene``, each where its nodes place it."""
    n_left = 0
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        shape = scene.geometry[key]
        if not _is_mesh(shape):
            n_left += 1
            continue
        meshes.append(_placed(str(node), str(key), *_pair(shape, str(key)), transform, detail))
    if n_left > 0:
        text = f"{n_left} of the scene's objects have no faces (points or lines), and are left out"
        warnings.warn(text, BakeWarning, stacklevel=4)
