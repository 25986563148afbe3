"""Bodies beyond the plain tube, solved by CalculiX 2.20 on fine meshes: tapered, with a lumen off the axis, with nu 0.4999.

`calculix_cases.csv` has the results, for two laws. They are computed on meshes of C3D20R that are finer each way than those of
the robots here: `FINE`. At nu 0.4999 the reduced integration of C3D20R does not lock; CalculiX has no mixed element for large
displacements.

    python -m gravcomp.references.calculix_cases src/gravcomp/references/calculix_cases.csv

computes the table again and needs `ccx` (Debian: calculix-ccx); it takes some minutes.
"""

import csv
import dataclasses
import math
import sys
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import numpy as np

from gravcomp.description import Elements, Lumen, Material, Robot, Segment
from gravcomp.mesh import tube_mesh
from gravcomp.references import calculix

FINE = Elements(around=12, along=20, radial=2, grading=12.0)
INCLINATIONS = 0.0, -45.0, 135.0  # deg
_LAWS = {"svk": 0.8e6, "neo_hookean": 0.7e6}  # with the modulus in Pa
_NAMES = "taper", "lumen off the axis", "nu 0.4999"


@dataclasses.dataclass(frozen=True)
class Case:
    """A solved case: name, law, inclination (rad), displacement (3,) of the end face in m."""

    name: str
    law: str
    inclination: float
    tip: np.ndarray

    @property
    def robot(self) -> Robot:
        """The robot of the case, without cables."""
        return robot_of(self.name, self.law)

    @property
    def gravity(self) -> np.ndarray:
        """Gravity (3,) in m/s^2."""
        return -calculix.GRAVITY * np.array([math.cos(self.inclination), 0.0, math.sin(self.inclination)])


def robot_of(name: str, law: str) -> Robot:
    """Return the robot of a case."""
    nu = 0.4999 if name == "nu 0.4999" else 0.45
    segment = Segment("body", 0.1, 9e-3, material=Material(law, _LAWS[law], nu, density=1150.0))
    if name == "taper":
        segment = dataclasses.replace(segment, tip_outer_diameter=6e-3, lumen_diameter=3e-3, tip_lumen_diameter=2e-3)
    elif name == "lumen off the axis":
        segment = dataclasses.replace(segment, lumens=(Lumen(3e-3, 1.0e-3, 1.2e-3),))
    else:
        segment = dataclasses.replace(segment, lumen_diameter=3e-3)
    return Robot(name, segments=(segment,), elements=Elements(around=8, along=12, radial=1, grading=8.0))


def stored_cases() -> list[Case]:
    """Return the stored table."""
    text = (resources.files("gravcomp.references") / "calculix_cases.csv").read_text(encoding="utf-8")
    return [
        Case(
            line["case"],
            line["law"],
            math.radians(float(line["incl_deg"])),
            1e-3 * np.array([float(line[f"tip_u{axis}_mm"]) for axis in "xyz"]),
        )
        for line in csv.DictReader(text.splitlines())
    ]


def computed_rows() -> Iterator[dict[str, str]]:
    """Solve every case with CalculiX, and yield the rows of the table. Raises RuntimeError."""
    for name in _NAMES:
        for law in _LAWS:
            mesh = tube_mesh(dataclasses.replace(robot_of(name, law), elements=FINE))
            for inclination in INCLINATIONS:
                tip = 1e3 * calculix.solve(mesh, math.radians(inclination))
                row = {"case": name, "law": law, "unknowns": str(3 * len(mesh.nodes)), "incl_deg": f"{inclination:g}"}
                yield row | {f"tip_u{axis}_mm": f"{value:.5f}" for axis, value in zip("xyz", tip)}


def main(path: str) -> None:
    """Compute the table and write it to `path`."""
    with Path(path).open("w", encoding="ascii", newline="") as file:
        writer = None
        for row in computed_rows():
            writer = writer or csv.DictWriter(file, list(row), lineterminator="\n")
            if file.tell() == 0:
                writer.writeheader()
            writer.writerow(row)
            file.flush()


if __name__ == "__main__":
    main(sys.argv[1])
