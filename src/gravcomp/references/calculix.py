"""CalculiX, a general finite-element program: run if it is installed, otherwise its stored results.

`calculix_h20r.csv` has the results of CalculiX 2.20 (C3D20R, 1 x 10 x 24 graded toward the clamp, large displacements) for the
hollow cylinder of 100 mm, 9 mm outside, 3 mm inside, 1150 kg/m^3; `REFERENCE` names that tube. Gravity is g (-cos, 0, -sin) of
the inclination.
"""

import csv
import math
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from gravcomp.description import Material, Robot, Segment
from gravcomp.description.robot_file import load_robot_file
from gravcomp.mesh import Mesh

GRAVITY = 9.81  # m/s^2
REFERENCE = {"length": 0.1, "outer_diameter": 9e-3, "inner_diameter": 3e-3, "density": 1150.0}
_LAWS = {"svk": "svk", "nh": "neo_hookean"}  # of the names in the table


@dataclass(frozen=True)
class Row:
    """A solved case: law, modulus Pa, Poisson's ratio, inclination rad, displacement (3,) m of the end face."""

    law: str
    youngs_modulus: float
    poissons_ratio: float
    inclination: float
    tip: np.ndarray

    @property
    def robot(self) -> Robot:
        """The tube of the case, see `tube_robot`."""
        return tube_robot(self.law, self.youngs_modulus, self.poissons_ratio)


def stored_rows() -> list[Row]:
    """Return the stored table."""
    text = (resources.files("gravcomp.references") / "calculix_h20r.csv").read_text(encoding="utf-8")
    return [
        Row(
            _LAWS[line["material"]],
            float(line["E_MPa"]) * 1e6,
            float(line["nu"]),
            math.radians(float(line["incl_deg"])),
            1e-3 * np.array([float(line[f"tip_u{axis}_mm"]) for axis in "xyz"]),
        )
        for line in csv.DictReader(text.splitlines())
    ]


def tube_robot(law: str, youngs_modulus: float, poissons_ratio: float = 0.45) -> Robot:
    """Return the tube of the table as a robot without cables, with the elements of the article's robot; youngs_modulus: Pa."""
    r = REFERENCE
    material = Material(law, youngs_modulus, poissons_ratio, density=r["density"])
    segment = Segment("tube", r["length"], r["outer_diameter"], r["inner_diameter"], material)
    return Robot("tube", segments=(segment,), elements=load_robot_file("article").robot.elements)


def installed() -> str | None:
    """Return the path of the solver; None if it is not installed."""
    return shutil.which("ccx")


def solve(mesh: Mesh, inclination: float) -> np.ndarray:
    """Return the displacement (3,) in m of the end face of a 'hex20' mesh of one material, see `end_face`.

    Raises RuntimeError, and ValueError for a law that CalculiX does not have in the same form.
    """
    return end_face(mesh, printed(deck(mesh, inclination)))


def printed(text: str) -> str:
    """Return what CalculiX prints to its .dat file for an input file. Raises RuntimeError."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "case.inp").write_text(text, encoding="ascii")
        try:
            done = subprocess.run([installed() or "ccx", "-i", "case"], cwd=folder, capture_output=True, text=True, timeout=600)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise RuntimeError(f"CalculiX did not run: {error}") from error
        output = Path(folder) / "case.dat"
        if done.returncode != 0 or not output.exists():
            raise RuntimeError(f"CalculiX ended with code {done.returncode}: {done.stdout.strip()[-200:]}")
        return output.read_text(encoding="utf-8")


def end_face(mesh: Mesh, output: str) -> np.ndarray:
    """Return the last displacement (3,) in m of the end face on the axis. Raises RuntimeError if there is none.

    It is that of the plane fitted to the face's nodes; with a symmetric section it is the nodes' mean.
    """
    tip = np.sort(mesh.tip)  # CalculiX prints a set in the order of the numbers
    moved = last_displacements(output)
    return np.linalg.lstsq(np.column_stack([np.ones(len(tip)), mesh.nodes[tip, :2]]), moved, rcond=None)[0][0]


def deck(mesh: Mesh, inclination: float) -> str:
    """Return the input file. The nodes of a 20-node hexahedron have the same order in VTK and C3D20R."""
    material = mesh.materials[0]
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i}, {x:.9e}, {y:.9e}, {z:.9e}" for i, (x, y, z) in enumerate(mesh.nodes, start=1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=BODY")
    for i, element in enumerate(mesh.elements + 1, start=1):
        lines += [", ".join(map(str, [i, *element[:15]])) + ",", ", ".join(map(str, element[15:]))]
    for name, nodes in (("CLAMP", mesh.clamped), ("TIP", mesh.tip)):
        lines += [f"*NSET, NSET={name}", *(f"{node + 1}," for node in nodes)]
    lines += [
        "*MATERIAL, NAME=SOFT",
        *_law(material),
        "*DENSITY",
        f"{material.density:.9e}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=SOFT",
        "*STEP, NLGEOM, INC=1000",
        "*STATIC",
        "0.1, 1.0",
        "*BOUNDARY",
        "CLAMP, 1, 3",
        "*DLOAD",
        f"BODY, GRAV, {GRAVITY}, {-math.cos(inclination):.9f}, 0.0, {-math.sin(inclination):.9f}",
        "*NODE PRINT, NSET=TIP",
        "U",
        "*END STEP",
    ]
    return "\n".join(lines) + "\n"


def _law(material: Material) -> list[str]:
    """Return the lines of a law that CalculiX has in the same form. Raises ValueError for another one."""
    young, nu = material.youngs_modulus, material.poissons_ratio
    if material.law == "svk":
        return ["*ELASTIC", f"{young:.9e}, {nu:.6f}"]
    if material.law == "neo_hookean":  # mu/2 (I1' - 3) + kappa/2 (J - 1)^2, written with C10 and D1
        return ["*HYPERELASTIC, NEO HOOKE", f"{young / (4 * (1 + nu)):.9e}, {6 * (1 - 2 * nu) / young:.9e}"]
    raise ValueError(f"the law '{material.law}' is not compared with CalculiX; allowed are 'svk' and 'neo_hookean'")


def last_displacements(output: str) -> np.ndarray:
    """Return the displacements (n, 3) in m of the last increment in a .dat file. Raises RuntimeError if there are none."""
    block = output.rpartition("displacements")[2]
    rows = [line.split() for line in block.splitlines()]
    values = [[float(x) for x in row[1:]] for row in rows if len(row) == 4 and row[0].isdigit()]
    if not values:
        raise RuntimeError("CalculiX wrote no displacements")
    return np.array(values)
