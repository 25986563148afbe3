"""The cross-sections of a body from a file, by which its own weight bends it."""

import numpy as np

from gravcomp.description.mesh_body import MeshBody
from gravcomp.description.section_moments import SectionMoments, boundary_moments
from gravcomp.mesh_files import MeshError
from gravcomp.mesh_files.level_cut import level_cut


def body_sections(body: MeshBody, stations: np.ndarray) -> list[SectionMoments]:
    """Return the moments of the sections of the straightened body at stations (k,) in m along its axis.

    The faces of quadratic elements count as flat. Raises MeshError for a file that describes no body, or one without a section.
    """
    surface = body.placed().straight_surface
    found = [boundary_moments(level_cut(surface, float(s))) for s in stations]
    for s, section in zip(stations, found):
        if section.area <= 0.0:
            raise MeshError(f"{body.file}: no cross-section at {1e3 * s:g} mm")
    return found
