"""Filling a surface by fTetWild (package wildmeshing), in a process of its own: it prints and cannot be interrupted."""

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.gmsh_library import INSTALL_LINE

TOLERANCE = 5e-4
"""Largest distance of the elements' surface from the body's, of the diagonal."""
_SHAPE_ENERGY = 10.0  # where fTetWild stops improving elements; a regular one has 3


def by_wildmeshing(nodes: np.ndarray, triangles: np.ndarray, element_size: float, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and linear tetrahedra (k, 4); lengths in m. Raises MeshError if it is missing or fails."""
    if importlib.util.find_spec("wildmeshing") is None:
        raise MeshError(f"{name}: the package wildmeshing is not installed; run: {INSTALL_LINE}")
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        given, result = Path(scratch) / "surface.npz", Path(scratch) / "volume.npz"
        np.savez(given, nodes=nodes, triangles=triangles, element_size=element_size)
        done = subprocess.run(
            [sys.executable, "-m", __name__, str(given), str(result)], cwd=scratch, capture_output=True, text=True,
            env=dict(os.environ, PYTHONPATH=os.pathsep.join(path for path in sys.path if path)),
        )  # fmt: skip
        if done.returncode != 0 or not result.exists():
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise MeshError(f"{name}: fTetWild cannot fill the surface (exit code {done.returncode}: {last})")
        with np.load(result) as content:
            points, elements = content["nodes"], content["elements"]
        if len(elements) == 0:
            raise MeshError(f"{name}: fTetWild made no tetrahedra")
        return points, elements


def _fill(given: str, result: str) -> None:
    """Fill the surface in the file `given`; write nodes and elements into the file `result`."""
    import wildmeshing

    with np.load(given) as content:
        nodes, triangles, size = content["nodes"], content["triangles"], float(content["element_size"])
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    mesher = wildmeshing.Tetrahedralizer(
        stop_quality=_SHAPE_ENERGY, epsilon=TOLERANCE, edge_length_r=size / diagonal, max_threads=1, coarsen=True
    )
    mesher.set_mesh(nodes / diagonal, triangles.astype(np.int32))
    mesher.tetrahedralize()
    points, elements = mesher.get_tet_mesh()[:2]
    used, numbers = np.unique(elements, return_inverse=True)
    np.savez(result, nodes=diagonal * np.asarray(points)[used], elements=numbers.reshape(-1, 4))


if __name__ == "__main__":
    _fill(*sys.argv[1:])
