"""Worlds, and the answers to questions about them."""

import builtins
import os
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union, overload

import numpy as np

from . import _arrays, _native


@dataclass(frozen=True)
class Why:
    """A decision of the bake about a cell, a portal or a place. ``str`` of it is the text."""

    reason: str
    """As in the file, such as ``"narrow"``; the page on reasons lists them."""
    margin: float
    """How far the fact that decided is from its limit: 0 at it, 1 far from it and where nothing was weighed."""
    limit: Optional[float]
    """The number of the rule, with which the fact was compared; None where nothing was weighed."""
    facts: Dict[str, float]
    """All that was measured, such as ``"area"``."""
    text: str
    """The decision, its margin and its facts in words."""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Place:
    """A place about which something was decided: an opening within a cell, or a space that is no cell."""

    at: Tuple[float, float, float]
    """A point of it."""
    why: Why


@dataclass(frozen=True)
class Surface:
    """A planar piece of the boundary of a room."""

    loops: Tuple[np.ndarray, ...]
    """Closed lines, (n, 3) float64: the outer one, counter-clockwise seen from outside of the room, then holes."""
    normal: Tuple[float, float, float]
    """Out of the room."""
    area: float
    """In square meters, without the holes."""
    behind: str
    """``"room"``, ``"outdoors"``, ``"ground"``, or ``"matter"``, where there is no air as far as a construction reaches."""
    cell: Optional[int]
    """The id of the cell behind."""
    thickness: float
    """That of the construction, in meters; 0 for openings and sheets."""
    pair: Optional[int]
    """The surface of the room behind that answers this one, as an index into its list."""
    host: Optional[int]
    """For an opening, the wall, floor or roof around it, as an index into the same list."""
    portal: Optional[int]
    """The id of the opening, if it is one."""
    object: Optional[str]
    """The name of what it is made of: ``IfcWall/GlobalId`` in models from IFC."""


@dataclass(frozen=True)
class IfcReport:
    """What was written into an IFC file."""

    added: int
    """Spaces that are new."""
    replaced: int
    """Spaces of the file that have the bodies of rooms now."""
    kept: int
    """Spaces of the file that stay as they were."""
    boundaries: int
    without_element: int
    """Surfaces that have no boundary, since nothing in the file makes them."""


@dataclass(frozen=True)
class Room:
    """What people ask of a room."""

    id: int
    """The id of its cell."""
    name: str
    storeys: Tuple[str, ...]
    """The names of the storeys that it stands on, from below."""
    floor_area: float
    """In square meters, as seen from above, without the recesses of doors and windows."""
    area_above_1_5: float
    """The part of it over which the room is 1.5 m high or more: less than all of it under sloped ceilings."""
    area_above_2_3: float
    """The part over which it is 2.3 m high or more."""
    height: float
    """The clear height over most of the floor, in meters."""
    doors: int
    windows: int
    volume: float
    """In cubic meters."""
    window_area: float
    """Of its windows to the outdoors, in square meters: the openings in the walls, with their frames."""

    @property
    def kind(self) -> str:
        """``"room"``, as its cell's kind."""
        return "room"


@dataclass(frozen=True, eq=False)
class Cell:
    """A connected region of air: a room, the outdoors, or a void in which nobody can stand."""

    id: int
    name: str
    """The name of the room in the scene, or ``cell-0``, ``cell-1``, …"""
    kind: str
    """``"room"``, ``"outdoors"`` or ``"void"`` (above ceilings, in walls and shafts)."""
    volume: float
    """In cubic meters."""
    bounds: np.ndarray
    """Two rows, the least and the greatest coordinates, as in trimesh. (2, 3) float32."""
    triangles: int
    """The number of triangles of walls seen without passing a portal."""
    portals: Tuple[int, ...]
    """The ids of its portals."""
    why: Tuple[Why, ...] = ()
    """Why it is there. Empty in files of older versions."""

    @property
    def outdoors(self) -> bool:
        """True for the space around the building, which is one cell."""
        return self.kind == "outdoors"

    def __repr__(self) -> str:
        return f"<Cell {self.id} {self.name!r}, {self.kind}, {self.volume:.1f} m³>"


@dataclass(frozen=True, eq=False)
class Portal:
    """An opening that joins two cells."""

    id: int
    kind: str
    """``"open"``, ``"door"``, ``"window"`` or ``"crack"``."""
    cells: Tuple[int, int]
    """The ids of its two cells."""
    polygon: np.ndarray
    """A convex outline around the opening, counter-clockwise seen from the second cell. (n, 3) float32."""
    area: float
    """The area of the opening itself, in square meters."""
    size: np.ndarray
    """Width and height, in meters. (2,) float32."""
    center: np.ndarray
    """(3,) float32."""
    normal: np.ndarray
    """The direction from the first cell to the second. (3,) float32."""
    why: Tuple[Why, ...] = ()
    """Why there are two cells. Empty in files of older versions."""

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Portal {self.id}, {self.kind}, {self.cells[0]}–{self.cells[1]}, {width:.2f} × {height:.2f} m>"


class Cells(Sequence[Cell]):
    """The cells of a world: a sequence, and their attributes as columns.

    ``cells[3]`` and ``cells["kitchen"]`` are cells; ``cells.volumes`` is an array.
    """

    names: List[str]
    kinds: List[str]
    volumes: np.ndarray
    """Volumes in cubic meters. (n,) float32."""
    bounds: np.ndarray
    """The least and the greatest coordinates. (n, 2, 3) float32."""

    def __init__(self, native: _native.World) -> None:
        columns = native.cells()
        self.names, self.kinds, self.volumes, bounds, self._triangles, self._portals = columns
        self.bounds = bounds.reshape(-1, 2, 3)
        self._whys = [_whys(of) for of in native.cell_whys()]
        _freeze(self.volumes, self.bounds)
        self._by_name: Dict[str, int] = {}
        for i, name in enumerate(self.names):
            self._by_name.setdefault(name, i)

    def __len__(self) -> int:
        return len(self.names)

    @overload
    def __getitem__(self, index: Union[int, str]) -> Cell: ...
    @overload
    def __getitem__(self, index: slice) -> List[Cell]: ...
    def __getitem__(self, index: Union[int, str, slice]) -> Union[Cell, List[Cell]]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if isinstance(index, str):
            if index not in self._by_name:
                raise KeyError(f"no cell is called {index!r}")
            index = self._by_name[index]
        i = _index(index, len(self), "cell")
        return Cell(
            i,
            self.names[i],
            self.kinds[i],
            float(self.volumes[i]),
            self.bounds[i],
            int(self._triangles[i]),
            tuple(self._portals[i]),
            self._whys[i],
        )

    def __repr__(self) -> str:
        counts = {kind: self.kinds.count(kind) for kind in ("room", "void", "outdoors")}
        return "<Cells: " + ", ".join(f"{n} {kind}" for kind, n in counts.items() if n > 0) + ">"


class Portals(Sequence[Portal]):
    """The portals of a world: a sequence, and their attributes as columns."""

    cells: np.ndarray
    """The ids of their two cells. (n, 2) int32."""
    kinds: List[str]
    areas: np.ndarray
    """Areas in square meters. (n,) float32."""
    sizes: np.ndarray
    """Widths and heights in meters. (n, 2) float32."""
    centers: np.ndarray
    """(n, 3) float32."""
    normals: np.ndarray
    """Directions from the first cell to the second. (n, 3) float32."""
    polygons: List[np.ndarray]
    """Outlines, each (n, 3) float32."""

    def __init__(self, native: _native.World) -> None:
        columns = native.portals()
        self.cells, self.kinds, self.areas, self.sizes, self.centers, self.normals, self.polygons = columns
        self._whys = [_whys(of) for of in native.portal_whys()]
        _freeze(self.cells, self.areas, self.sizes, self.centers, self.normals, *self.polygons)

    def __len__(self) -> int:
        return len(self.kinds)

    @overload
    def __getitem__(self, index: int) -> Portal: ...
    @overload
    def __getitem__(self, index: slice) -> List[Portal]: ...
    def __getitem__(self, index: Union[int, slice]) -> Union[Portal, List[Portal]]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        i = _index(index, len(self), "portal")
        one, other = self.cells[i].tolist()
        return Portal(
            i,
            self.kinds[i],
            (one, other),
            self.polygons[i],
            float(self.areas[i]),
            self.sizes[i],
            self.centers[i],
            self.normals[i],
            self._whys[i],
        )

    def __repr__(self) -> str:
        counts = {kind: self.kinds.count(kind) for kind in ("open", "door", "window", "crack")}
        return "<Portals: " + ", ".join(f"{n} {kind}" for kind, n in counts.items() if n > 0) + ">"


@dataclass(frozen=True, eq=False)
class View:
    """What one view sees. Never leaves out anything visible."""

    eye_cell: int
    """The cell of the eye; -1 in matter, where all that meets the view counts as visible."""
    cells: np.ndarray
    """Visible cells from near to far. (n,) int32."""
    portals: np.ndarray
    """Portals looked through. (n,) int32."""
    batches: np.ndarray
    """Batches of walls in the file, with visible triangles. (n,) int32."""
    details: np.ndarray
    """Visible objects, such as furniture. (n,) int32."""
    draws: np.ndarray
    """Rows of batch, first index and number of indices: the draws of a renderer. (n, 3) int64."""
    triangles: int
    """The number of triangles to draw."""
    of_triangles: int
    """The number of triangles in the world."""


@dataclass(frozen=True, eq=False)
class Path:
    """A walk from one point to another."""

    length: float
    """In meters."""
    length_in_plan: float
    """In meters, as seen from above."""
    cells: Tuple[int, ...]
    """The cells on the way, in order."""
    portals: Tuple[int, ...]
    """The portals passed, in order."""
    points: np.ndarray
    """The start, the points where the walk bends, the end; at the feet. (n, 3) float64."""


@dataclass(frozen=True)
class Storey:
    """Connected floors, none above another."""

    name: str
    floor: float
    """The height of its floor, in meters."""
    cells: Tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Pvs:
    """The potentially visible set: for each cell, the cells of which something may be seen from somewhere in it.

    Rows as in ``scipy.sparse.csr_array((pvs.data, pvs.indices, pvs.indptr))``.
    """

    indptr: np.ndarray
    """Row ``i`` is ``indices[indptr[i]:indptr[i + 1]]``. (n + 1,) int64."""
    indices: np.ndarray
    """Ascending in each row. int32."""

    def __len__(self) -> int:
        return len(self.indptr) - 1

    @property
    def data(self) -> np.ndarray:
        """A true for each of ``indices``."""
        return np.ones(len(self.indices), dtype=bool)

    def visible_from(self, cell: int) -> np.ndarray:
        """Returns the cells visible from a cell, ascending, with itself."""
        i = _index(cell, len(self), "cell")
        return self.indices[self.indptr[i] : self.indptr[i + 1]]

    def matrix(self) -> np.ndarray:
        """Returns the set as (n, n) bool: a row for each cell from which is looked."""
        out = np.zeros((len(self), len(self)), dtype=bool)
        out[np.repeat(np.arange(len(self)), np.diff(self.indptr)), self.indices] = True
        return out


class World:
    """Cells, portals, and the answers to questions about them. Made by ``bake``, or read by ``open``.

    Meters, +y up, right-handed. Queries keep what they need from call to call; any number of threads may ask.
    """

    def __init__(self, native: _native.World) -> None:
        self._native = native
        self._cells: Optional[Cells] = None
        self._portals: Optional[Portals] = None

    @classmethod
    def from_bytes(cls, data: bytes) -> "World":
        """Reads a world from the bytes of its file."""
        return cls(_native.World.of_bytes(data))

    def save(self, path: "os.PathLike[str] | str", *, pvs: bool = False) -> None:
        """Writes the world as one GLB, whole or not at all. Equal input gives equal bytes.

        pvs: write what is seen from each cell, too; computes it if need be.
        """
        if pvs:
            self._native.pvs(False, None, None)
        self._native.save(os.fspath(path), pvs)

    def __bytes__(self) -> bytes:
        return self._native.to_bytes()

    def __reduce__(self) -> Tuple[Any, ...]:
        return World.from_bytes, (bytes(self),)

    @property
    def cells(self) -> Cells:
        """Rooms, voids and the outdoors."""
        if self._cells is None:
            self._cells = Cells(self._native)
        return self._cells

    @property
    def portals(self) -> Portals:
        """Doors, windows and other openings."""
        if self._portals is None:
            self._portals = Portals(self._native)
        return self._portals

    @property
    def rooms(self) -> List[Room]:
        """Floor area, height, volume, storeys, doors and windows of each room, by the ids of their cells."""
        cells, portals = self.cells, self.portals
        glass = np.zeros(len(cells))
        is_out = np.array([kind == "outdoors" for kind in cells.kinds] + [False])
        is_window = np.array([kind == "window" for kind in portals.kinds], dtype=bool)
        for one, other in ((0, 1), (1, 0)):
            counts = is_window & is_out[portals.cells[:, other]]
            np.add.at(glass, portals.cells[counts, one], portals.areas[counts])
        rooms = []
        for id, on, measures, (doors, windows) in self._native.rooms():
            area, above_1_5, above_2_3, height = measures
            volume = float(cells.volumes[id])
            rooms.append(
                Room(id, cells.names[id], tuple(on), area, above_1_5, above_2_3, height, doors, windows, volume, float(glass[id]))
            )
        return rooms

    def outlines(self, *, height: float = 1.2) -> Dict[int, List[np.ndarray]]:
        """Returns the outlines of rooms on the plans, by the ids of their cells.

        Each is a list of closed lines, (n, 2) float64 of x and z, which do not repeat their first point; a point inside an odd
        number of them is in the room, so that holes are lines, too. A room on several storeys has the lines of all its plans.

        height: that of the cut above each floor, in meters.
        """
        out: Dict[int, List[np.ndarray]] = {}
        for storey in self.storeys:
            for kind, _, _, lines, _, cell in self._native.plan_shapes(storey.name, height)[0]:
                if kind == "cell" and cell is not None:
                    out.setdefault(cell, []).extend(lines)
        return out

    def polygons(self, *, height: float = 1.2) -> Dict[int, Any]:
        """Returns the ``outlines`` of rooms as geometries of shapely, by the ids of their cells."""
        shapely = _lazily("shapely")
        out = {}
        for cell, lines in self.outlines(height=height).items():
            whole = shapely.Polygon()
            for line in lines:
                if len(line) > 2:
                    whole = whole.symmetric_difference(shapely.Polygon(line).buffer(0))
            out[cell] = whole
        return out

    def surfaces(self, *, level: str = "second") -> Dict[int, List[Surface]]:
        """Returns the boundary surfaces of rooms, by the ids of their cells. Those of a room close.

        level: ``"first"`` has one surface for each plane and object; ``"second"`` cuts them where what lies behind changes.
        """
        rooms = self._native.surfaces(_is_first(level))
        return {cell: [_surface(row) for row in own] for cell, own in rooms}

    def to_ifc(
        self,
        model: "os.PathLike[str] | str",
        path: "os.PathLike[str] | str",
        *,
        replace_spaces: bool = False,
        level: str = "second",
    ) -> IfcReport:
        """Writes the rooms as spaces, with quantities and boundaries, into a copy of the IFC file that was baked.

        replace_spaces: give spaces that are there, and are rooms, the bodies and boundaries that were found.
        level: of the boundaries, as in ``surfaces``.
        """
        with builtins.open(model, "rb") as file:
            data = file.read()
        out, counts = self._native.ifc(data, replace_spaces, _is_first(level))
        # Whole or not at all.
        part = f"{os.fspath(path)}.part"
        with builtins.open(part, "wb") as file:
            file.write(out)
        os.replace(part, path)
        return IfcReport(*counts)

    def to_gbxml(self) -> str:
        """Returns the rooms as gbXML 6.01, for programs that calculate energy."""
        return self._native.gbxml()

    def to_hbjson(self) -> str:
        """Returns the rooms as a Honeybee model in JSON, for Ladybug Tools, OpenStudio and EnergyPlus.

        Rooms are simpler than in the world: small details vanish. ``user_data`` of each has the volume there, and a note if it is
        now another by more than 3 %.
        """
        return self._native.hbjson()

    def to_indoorgml(self) -> str:
        """Returns the rooms as IndoorGML 1.1, for indoor navigation."""
        return self._native.indoor_gml()

    def to_dataframe(self, of: str = "rooms") -> Any:
        """Returns a ``pandas.DataFrame`` of ``"rooms"``, ``"portals"`` or ``"visibility"``.

        Rooms and portals have a row each, by their ids; visibility has a row and a column for each cell, by their names, true where
        something of the column's cell may be seen from the row's.
        """
        pandas = _lazily("pandas")
        if of == "rooms":
            columns = (
                "name storeys floor_area area_above_1_5 area_above_2_3 height volume doors windows window_area".split()
            )
            rows = [[getattr(room, column) for column in columns] for room in self.rooms]
            frame = pandas.DataFrame(rows, columns=columns)
            frame["storeys"] = frame["storeys"].map(", ".join)
            frame.index = pandas.Index([room.id for room in self.rooms], name="id")
            return frame
        if of == "portals":
            portals, names = self.portals, self.cells.names
            ends = [[names[cell] for cell in portals.cells[:, end]] for end in (0, 1)]
            table: Dict[str, Any] = {"kind": portals.kinds, "cell": ends[0], "other": ends[1], "area": portals.areas}
            table["width"], table["height"] = portals.sizes.T
            table["x"], table["y"], table["z"] = portals.centers.T
            return pandas.DataFrame(table).rename_axis("id")
        if of == "visibility":
            names = self.cells.names
            return pandas.DataFrame(self.pvs().matrix(), index=names, columns=names)
        raise ValueError(f"of is {of!r}: expected 'rooms', 'portals' or 'visibility'")

    @property
    def places(self) -> List[Place]:
        """Openings within cells that nearly part them, and spaces as large as a room that are no cells, with the reasons."""
        return [Place((x, y, z), Why(*why)) for (x, y, z), why in self._native.places()]

    @property
    def storeys(self) -> List[Storey]:
        """Storeys from the lowest up; each has a plan."""
        return [Storey(name, floor, tuple(cells)) for name, floor, cells in self._native.storeys()]

    @property
    def verdict(self) -> str:
        """How far to trust it, in a sentence that begins with ``trust: good``, ``fair``, ``low`` or ``none``."""
        from ._bake import _in_python

        return _in_python(self._native.verdict())

    @property
    def counts(self) -> Dict[str, float]:
        """Counts of the bake, such as ``input_triangles``."""
        return dict(self._native.about()[0])

    @property
    def provenance(self) -> Dict[str, str]:
        """The program, the method, a hash of the input, and all settings."""
        return dict(self._native.about()[1])

    def locate(self, points: Any) -> Any:
        """Returns the cells of points: (n,) int32 for an (n, 3) array, a number for one point; -1 in matter."""
        array = np.asarray(points)
        if array.shape == (3,):
            return int(self._native.locate(_arrays.points("points", array[np.newaxis]))[0])
        return self._native.locate(_arrays.points("points", array))

    def see(
        self,
        eye: Any,
        look: Any,
        *,
        up: Any = (0.0, 1.0, 0.0),
        fov: float = 60.0,
        aspect: float = 16 / 9,
        far: Optional[float] = None,
        closed: Any = (),
    ) -> View:
        """Returns what a view sees, in microseconds.

        eye, look: the eye, and a point that it looks at; not a direction.
        fov: the angle from the lower to the upper edge of the picture, in degrees; from 180 on all around.
        aspect: its width divided by its height.
        far: treat everything farther than this as hidden, in meters.
        closed: ids of portals that are shut.
        """
        start, end = _arrays.point("eye", eye), _arrays.point("look", look)
        # As the command does: rounded to single precision before the difference.
        x, y, z = (np.asarray(end, np.float32) - np.asarray(start, np.float32)).tolist()
        found = self._native.see(
            start,
            (x, y, z),
            _arrays.point("up", up),
            float(np.radians(np.float32(fov))),
            float(aspect),
            far,
            _ids(closed),
        )
        eye_cell, cells, portals, batches, details, draws, (triangles, of_triangles) = found
        eye_cell = -1 if eye_cell is None else eye_cell
        return View(eye_cell, cells, portals, batches, details, draws, triangles, of_triangles)

    def pvs(
        self, *, fast: bool = False, threads: Optional[int] = None, max_memory: Optional[int] = None
    ) -> Pvs:
        """Returns the cells visible from each cell; computed once, and kept. An interrupt ends it.

        fast: a larger answer, in less time; not kept.
        max_memory: refuse a world that is estimated to need more, in bytes; 8 GiB by default.
        """
        indptr, indices = self._native.pvs(fast, threads, max_memory)
        _freeze(indptr, indices)
        return Pvs(indptr, indices)

    def path(
        self,
        start: Any,
        end: Any,
        *,
        radius: float = 0.25,
        height: float = 1.8,
        step: float = 0.3,
        closed: Any = (),
        objects: bool = True,
    ) -> Path:
        """Returns the walk from one point to another, over floors and stairs, around walls and furniture.

        start, end: points at the feet, or at any height up to the head.
        radius, height, step: the walker's, in meters: its distance from walls, its height, its highest step.
        closed: ids of portals that are shut; other doors it opens.
        objects: False to walk through objects, such as furniture.

        The first path of a walker takes seconds in a large building, later ones milliseconds. Raises ``NoPathError`` if
        there is none: it names the door or place where the walk ends, and how far one gets.
        """
        ends = [_arrays.point("start", start), _arrays.point("end", end)]
        found = self._native.path(ends, radius, height, step, _ids(closed), objects)
        length, in_plan, cells, portals, points = found
        return Path(length, in_plan, tuple(cells), tuple(portals), points)

    def to_networkx(self) -> Any:
        """Returns a ``networkx.MultiGraph``: a node for each cell, an edge for each portal, keyed by its id.

        Nodes have ``name``, ``kind``, ``volume`` and ``bounds``; edges ``kind``, ``area`` and ``center``.
        """
        networkx = _lazily("networkx")
        graph = networkx.MultiGraph()
        for cell in self.cells:
            graph.add_node(
                cell.id, name=cell.name, kind=cell.kind, volume=cell.volume, bounds=cell.bounds
            )
        for portal in self.portals:
            graph.add_edge(
                *portal.cells, key=portal.id, kind=portal.kind, area=portal.area, center=portal.center
            )
        return graph

    def plan_svg(self, storey: Optional[str] = None, *, height: float = 1.2) -> str:
        """Returns floor plans as SVG: of all storeys, or of one, by its name or that of a room on it.

        height: that of the cut above each floor, in meters.
        """
        return self._native.plan_svg(storey, height)

    def _repr_svg_(self) -> str:
        return self.plan_svg()

    def plot(
        self, ax: Any = None, *, storey: Optional[str] = None, height: float = 1.2, labels: bool = True
    ) -> Any:
        """Draws the plan of a storey with matplotlib, and returns the axes.

        Without ``ax`` and ``storey``, a new figure shows all storeys side by side, the lowest first, and the axes are a list. On
        given axes, the lowest storey is drawn if none is named.

        Coordinates are those of the world: x to the right, z down. So ``ax.scatter(points[:, 0], points[:, 2])`` marks
        points on the plan.
        """
        from ._plot import draw, draw_all

        if ax is None and storey is None:
            return draw_all(self._native, [s.name for s in self.storeys], height, labels)
        return draw(self._native, ax, storey, height, labels)

    def __repr__(self) -> str:
        rooms = self.cells.kinds.count("room")
        return f"<enfilade.World: {rooms} rooms, {len(self.cells)} cells, {len(self.portals)} portals>"


def open(path: "os.PathLike[str] | str") -> World:  # noqa: A001
    """Reads a world that ``World.save`` or ``enfilade bake`` wrote. All of it is checked: queries cannot fail later.

    Raises ``FileNotFoundError``, and ``WorldError`` if the file is not a world, or is damaged.
    """
    return World(_native.World.open(os.fspath(path)))


def _ids(portals: Any) -> List[int]:
    return [int(getattr(portal, "id", portal)) for portal in portals]


def _index(index: Any, n: int, what: str) -> int:
    i = int(index)
    if not -n <= i < n:
        raise IndexError(f"{what} {i}: the world has {n}, counted from 0")
    return i % n


def _whys(decisions: List[Tuple[Any, ...]]) -> Tuple[Why, ...]:
    return tuple(Why(*why) for why in decisions)


def _freeze(*arrays: np.ndarray) -> None:
    for array in arrays:
        array.flags.writeable = False


def _lazily(name: str) -> Any:
    """Imports a package that only one function needs."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.split(".")[0]
        raise ImportError(f"this needs {package}: pip install {package}", name=package) from None


def _is_first(level: str) -> bool:
    if level not in ("first", "second"):
        raise ValueError(f"level is {level!r}: expected 'first' or 'second'")
    return level == "first"


def _surface(row: Tuple[Any, ...]) -> Surface:
    loops, normal, area, behind, cell, thickness, (pair, host), portal, name = row
    return Surface(tuple(loops), tuple(normal), area, behind, cell, thickness, pair, host, portal, name)
