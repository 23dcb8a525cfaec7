"""Floor plans with matplotlib."""

from typing import Any, List, Optional

import numpy as np

from . import _native
from ._world import _lazily

CENTIMETER = 0.01
"""Widths of lines are in centimeters of the building."""


def draw(native: _native.World, ax: Any, storey: Optional[str], height: float, labels: bool) -> Any:
    """Draws the plan of a storey on axes, or on new ones; returns them."""
    pyplot = _lazily("matplotlib.pyplot") if ax is None else None
    patches = _lazily("matplotlib.patches")
    paths = _lazily("matplotlib.path")
    shapes, words = native.plan_shapes(storey, height)
    if pyplot is not None:
        ax = pyplot.gca()
    for kind, fill, stroke, lines, is_closed, _ in shapes:
        path = _path(paths.Path, lines, is_closed)
        if path is None:
            continue
        color = "none" if fill is None or not is_closed else (*(c / 255 for c in fill[0]), fill[1])
        edge = "none" if stroke is None else tuple(c / 255 for c in stroke[0])
        # Points of 1/72 inch do not zoom with the plan: thin lines, and doors three times as wide.
        width = 0 if stroke is None else 0.4 + 0.25 * stroke[1]
        ax.add_patch(
            patches.PathPatch(path, facecolor=color, edgecolor=edge, linewidth=width, gid=kind)
        )
    if labels:
        _write(ax, words, patches)
    ax.autoscale_view()
    ax.set_aspect("equal")
    # Seen from above, z points down.
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    ax.set_xlabel("x (m)")
    ax.set_ylabel("z (m)")
    return ax


def draw_all(native: _native.World, storeys: List[str], height: float, labels: bool) -> List[Any]:
    """Draws all storeys side by side, in a new figure as wide as their names need; returns the axes."""
    pyplot = _lazily("matplotlib.pyplot")
    n = max(len(storeys), 1)
    columns = min(n, 3)
    rows = -(-n // columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(9 * columns, 7 * rows), squeeze=False, layout="constrained")
    axes = list(axes.flat)
    for ax, name in zip(axes, storeys):
        draw(native, ax, name, height, labels)
        ax.set_title(f"storey {name}")
    for ax in axes[len(storeys) :]:
        ax.set_axis_off()
    return axes[: len(storeys)]


def _path(path: Any, lines: Any, is_closed: bool) -> Any:
    """Returns lines as one path, so that holes stay open."""
    points, codes = [], []
    for line in lines:
        if len(line) == 0:
            continue
        codes += [path.MOVETO] + [path.LINETO] * (len(line) - 1)
        points.append(line)
        if is_closed:
            codes.append(path.CLOSEPOLY)
            points.append(line[:1])
    return path(np.concatenate(points), codes) if points else None


def _write(ax: Any, words: Any, patches: Any) -> None:
    """Writes names in letters that zoom with the plan."""
    text_path = _lazily("matplotlib.textpath").TextPath
    transforms = _lazily("matplotlib.transforms")
    for (x, z), size, is_turned, text, _ in words:
        letters = text_path((0, 0), text, size=size * 0.8)
        extents = letters.get_extents()
        # Downwards is positive in a plan.
        place = transforms.Affine2D().translate(-(extents.x0 + extents.x1) / 2, 0).scale(1, -1)
        if is_turned:
            place = place.rotate_deg(-90)
        path = place.translate(x, z).transform_path(letters)
        ax.add_patch(patches.PathPatch(path, facecolor="#222222", edgecolor="none", gid="label"))
