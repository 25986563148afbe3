"""A picture of the places where a surface is flawed, next to its file."""

import os
import tempfile
from pathlib import Path

import numpy as np

from gravcomp.mesh_files.errors import MeshError

# More triangles make the picture slow and no clearer.
_DRAWN = 20_000


def with_picture(text: str, path: Path, nodes: np.ndarray, faces: np.ndarray, places: np.ndarray) -> MeshError:
    """Return the error `text`, with the path of a picture of the surface and of the flawed places (p, 3), if one can be drawn."""
    picture = _draw(path, nodes, faces, places)
    return MeshError(f"{text}. Picture: {picture}" if picture else text)


def _draw(path: Path, nodes: np.ndarray, faces: np.ndarray, places: np.ndarray) -> Path | None:
    from gravcomp.environment.errors import SetupError
    from gravcomp.environment.packages import provide_extra

    try:
        provide_extra("reports")
        from matplotlib.figure import Figure
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection
    except (ImportError, SetupError):
        return None
    figure = Figure(figsize=(12, 6))
    drawn = faces[:: max(1, -(-len(faces) // _DRAWN))]
    for index, (elevation, azimuth) in enumerate(((20.0, -60.0), (20.0, 120.0))):
        axes = figure.add_subplot(1, 2, index + 1, projection="3d")
        axes.add_collection3d(Poly3DCollection(nodes[drawn], facecolor="0.85", edgecolor="0.6", linewidth=0.2, alpha=0.35))
        axes.plot(*places.T, "o", color="tab:red", markersize=4, label="flaw")
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        half = (high - low).max() / 2
        for middle, limits in zip((low + high) / 2, (axes.set_xlim, axes.set_ylim, axes.set_zlim)):
            limits(middle - half, middle + half)
        axes.set(xlabel="x / units of the file", ylabel="y", zlabel="z")
        axes.view_init(elevation, azimuth)
    figure.suptitle(f"{path.name}: flaws in red")
    for folder in (path.parent, Path.cwd(), Path(tempfile.gettempdir())):
        if os.access(folder, os.W_OK):
            target = folder / f"{path.stem}_flaws.png"
            figure.savefig(target, dpi=100)
            return target
    return None
