"""Where walls leave less room than the robot needs: the reason why there is no equilibrium."""

import numpy as np

from gravcomp.contact.outline_gap import deepest
from gravcomp.contact.surface import ContactSurface
from gravcomp.scene.distance import SceneArrays, gap_to

# Cosine between the normals of two walls below which they press from both sides.
_OPPOSED = -0.7


def squeezed(arrays: SceneArrays, names: tuple[str, ...], surface: ContactSurface, sections: np.ndarray) -> str:
    """Return a sentence on the narrowest place at which the sections (s, 3, 3) do not fit between walls; empty without any.

    At each station that is in a wall, the point of its outline on the other side is looked at: where the wall there faces the
    first, and the two gaps together are negative, there is less room than the robot needs. names: of the obstacles.
    """
    own, normal, facing = np.zeros(2), np.zeros(3), np.zeros(3)
    worst, found = 0.0, ""
    for station, section in enumerate(sections):
        for row in range(len(arrays.kind)):
            gap = deepest(arrays, row, surface, station, section, own, normal)
            if gap >= 0.0:
                continue
            opposite = section[0] - own[0] * section[1] - own[1] * section[2]
            for other in range(len(arrays.kind)):
                missing = -gap - gap_to(arrays, other, opposite, facing)
                if facing @ normal < _OPPOSED and missing > worst:
                    worst = missing
                    needed = 2.0 * float(np.linalg.norm(own))
                    first, second = (names[arrays.obstacle[k]] for k in (row, other))
                    between = f"'{first}'" if first == second else f"'{first}' and '{second}'"
                    found = (
                        f"between the walls of {between} there are {1e3 * max(needed - missing, 0.0):.3g} mm,"
                        f" {1e3 * surface.place[station]:.0f} mm from the base, where the robot needs {1e3 * needed:.3g} mm"
                    )
    return found
