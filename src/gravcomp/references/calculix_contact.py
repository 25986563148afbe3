"""A cylinder that sags on a plane, solved by CalculiX 2.20 with contact, for comparison of tips and of the plane's force.

The lowest line of the mesh's nodes cannot pass the plane: gap elements (GAPUNI), each between such a node and a fixed one, on a
spring of 1e4 N/m, which is a depth of a few micrometres here. The elements are those of the model: C3D20R on the same mesh.
`calculix_contact.csv` has the results.

    python -m gravcomp.references.calculix_contact src/gravcomp/references/calculix_contact.csv

computes the table again and needs `ccx` (Debian: calculix-ccx); it takes a minute.
"""

import csv
import dataclasses
import sys
from importlib import resources
from pathlib import Path

import numpy as np

from gravcomp.description import Elements, Material, Robot, Segment
from gravcomp.mesh import Mesh, tube_mesh
from gravcomp.references import calculix

GAPS = 2.0, 5.0, 15.0  # mm, of the straight cylinder over the plane; it sags by 31 mm without one
_SPRING, _PULL = 1e4, 1e-8  # N/m; N, of an open gap
_LENGTH, _DIAMETER = 0.1, 9e-3  # m


@dataclasses.dataclass(frozen=True)
class Rest:
    """A solved case: gap in m under the straight cylinder, displacement (3,) of the end face in m, force of the plane in N."""

    gap: float
    tip: np.ndarray
    force: float


def cylinder() -> Robot:
    """Return the robot of all cases, without cables."""
    material = Material("svk", 0.8e6, 0.3, density=1150.0)
    segment = Segment("body", _LENGTH, _DIAMETER, material=material)
    return Robot("cylinder on a plane", segments=(segment,), elements=Elements(around=8, along=12, grading=6.0))


def stored_rests() -> list[Rest]:
    """Return the stored table."""
    text = (resources.files("gravcomp.references") / "calculix_contact.csv").read_text(encoding="utf-8")
    return [
        Rest(
            1e-3 * float(line["gap_mm"]),
            1e-3 * np.array([float(line[f"tip_u{axis}_mm"]) for axis in "xyz"]),
            1e-3 * float(line["force_mn"]),
        )
        for line in csv.DictReader(text.splitlines())
    ]


def deck(mesh: Mesh, gap: float) -> str:
    """Return the input file for a plane `gap` m under the mesh."""
    lines = calculix.deck(mesh, 0.0).splitlines()
    nodes, elements = len(mesh.nodes), len(mesh.elements)
    low = mesh.nodes[:, 0].min()
    lowest = np.setdiff1d(np.flatnonzero(mesh.nodes[:, 0] < low + 1e-9), mesh.clamped)

    def before(start: str, added: list[str]) -> None:
        at = next(i for i, line in enumerate(lines) if line.startswith(start))
        lines[at:at] = added

    below = mesh.nodes[lowest] - [gap, 0.0, 0.0]
    before("*ELEMENT", [f"{nodes + 1 + i}, {x:.9e}, {y:.9e}, {z:.9e}" for i, (x, y, z) in enumerate(below)])
    pairs = [f"{elements + 1 + i}, {nodes + 1 + i}, {node + 1}" for i, node in enumerate(lowest)]
    ground = ["*NSET, NSET=GROUND", *(f"{nodes + 1 + i}," for i in range(len(lowest)))]
    before("*NSET, NSET=CLAMP", ["*ELEMENT, TYPE=GAPUNI, ELSET=GAPS", *pairs, *ground])
    before("*STEP", ["*GAP, ELSET=GAPS", f"{gap:.9e}, 1.0, 0.0, 0.0, , {_SPRING:g}, {_PULL:g}"])
    before("*DLOAD", ["GROUND, 1, 3"])
    before("*END STEP", ["*NODE PRINT, NSET=GROUND, TOTALS=ONLY", "RF"])
    return "\n".join(lines) + "\n"


def solve(gap: float) -> Rest:
    """Solve one case with CalculiX. Raises RuntimeError."""
    mesh = tube_mesh(cylinder())
    shapes, _, forces = calculix.printed(deck(mesh, gap)).rpartition("total force")
    numbers = [line.split() for line in forces.splitlines() if len(line.split()) == 3]
    return Rest(gap, calculix.end_face(mesh, shapes), abs(float(numbers[0][0])))


def main(path: str) -> None:
    """Compute the table and write it to `path`."""
    with Path(path).open("w", encoding="ascii", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["gap_mm", "tip_ux_mm", "tip_uy_mm", "tip_uz_mm", "force_mn"])
        for gap in GAPS:
            rest = solve(1e-3 * gap)
            writer.writerow([f"{gap:g}", *(f"{1e3 * value:.5f}" for value in rest.tip), f"{1e3 * rest.force:.5f}"])


if __name__ == "__main__":
    main(sys.argv[1])
