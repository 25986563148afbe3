"""Reductions in the cache, by content: a robot with another mesh, material, cables or payload has another entry.

Only the ratios of the Young's moduli are part of the key: a reduction is valid for all moduli in the range that it was trained
for.
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.description import Cable, CableLine, Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.materials.laws import LAWS
from gravcomp.mechanics.corotational import CorotationalElements
from gravcomp.reduction.cubature import Cubature
from gravcomp.reduction.reduced_model import ReducedModel, project
from gravcomp.reduction.strain_polynomials import StrainPolynomials

# Part of the key; increase it when the stored content or the training changes.
_FORMAT = 18


@dataclass(frozen=True)
class Reduction:
    """Stored result of the training.

    basis (3 n_free, r), elasticity and the cubature of the law's deviation at the Young's modulus `modulus` of the first
    material in Pa; reach: largest |q| to use it for; modulus_low and modulus_high: trained range in Pa; samples: number of
    trained shapes; error_median and error_worst: tip error in m over shapes that were not trained.
    """

    basis: np.ndarray
    elasticity: StrainPolynomials
    cubature: Cubature
    reach: float
    modulus: float
    modulus_low: float
    modulus_high: float
    samples: int
    error_median: float
    error_worst: float

    def of_first(self, modes: int, extra: int) -> "Reduction":
        """Return the reduction on its first modes, with the strains of these and the first `extra` principal ones."""
        basis = np.ascontiguousarray(self.basis[:, :modes])
        return dataclasses.replace(self, basis=basis, elasticity=self.elasticity.of_first(modes, extra))

    def reduced_model(self, model: RobotModel) -> ReducedModel:
        """Return the reduced model; the model's modulus may differ from `modulus`."""
        # With moduli s times as large, a basis of energy 1 is sqrt(s) times smaller, and so are the products of its gradients.
        root = float(np.sqrt(first_modulus(model) / self.modulus))
        elasticity = StrainPolynomials(self.elasticity.linear, self.elasticity.quadratic / root)
        return project(model, self.basis / root, elasticity, self.cubature, self.reach * root, self.error_worst)


def why_not(model: RobotModel) -> str:
    """Return the reason why a robot cannot be reduced, as a sentence; empty if it can."""
    if isinstance(model.elements, CorotationalElements):
        return "corotational tetrahedra have no polynomial strain: the full model is used"
    return ""


def first_modulus(model: RobotModel) -> float:
    """Return the Young's modulus of the first material in Pa, to which the others are relative."""
    return model.mesh.materials[0].youngs_modulus


def path_of(model: RobotModel) -> Path:
    """Return the path of the model's reduction in the cache; the file may not exist yet."""
    materials = [dataclasses.asdict(material) for material in model.mesh.materials]
    for material in materials:
        material["youngs_modulus"] = round(material["youngs_modulus"] / first_modulus(model), 9)
        for viscous in ("damping_time", "creep_ratio", "creep_time", "prony"):
            del material[viscous]
        if material["fibres"] is None:
            del material["fibres"]
        for law in LAWS.values():  # a constant counts only for the law that has it
            for name in set(law.own_constants) - set(LAWS[material["law"]].own_constants):
                material.pop(name, None)
    mesh, robot = model.mesh, model.robot
    cables = [_path_of_cable(cable) for cable in robot.cables]
    key = content_key(
        _FORMAT,
        mesh.kind,
        mesh.nodes,
        mesh.elements,
        mesh.region,
        materials,
        cables,
        *_payload(robot),
        *(["max_wrench", dataclasses.asdict(robot.max_wrench)] if robot.max_wrench else []),
        *_loads(robot),
        *_disks(robot),
        *(["mean volume"] if model.elements.averaged.any() else []),
    )
    return cache_path("reduction", key, ".npz")


def _path_of_cable(cable: Cable) -> dict:
    """Return what the reduction depends on: path and friction. A calibration of the line's stretch does not require a new one."""
    path = dataclasses.asdict(cable)
    for field in dataclasses.fields(CableLine):
        del path[field.name]
    return path | {"friction": cable.friction or 0.0}


def _loads(robot: Robot) -> list:
    """Return the weights hung from the body; empty without any, so that such robots keep their keys."""
    return [[dataclasses.asdict(load) for load in robot.loads]] if robot.loads else []


def _payload(robot: Robot) -> list:
    """Return the payload; its centre only where it is not at the tip, so that such robots keep their keys."""
    mass, centre = {"mass": robot.payload.mass}, robot.payload.centre
    return [mass, centre] if any(centre) else [mass]


def _disks(robot: Robot) -> list:
    """Return what disks there are, segment by segment; empty without disks, so that such robots keep their keys."""
    disks = [segment.disks and dataclasses.asdict(segment.disks) for segment in robot.segments]
    return [disks] if any(disks) else []


def save(reduction: Reduction, path: Path) -> None:
    """Write the reduction atomically."""
    parts: dict[str, Any] = {}
    for name in ("elasticity", "cubature"):
        part_of = getattr(reduction, name)
        parts |= {f"{name}_{f.name}": getattr(part_of, f.name) for f in dataclasses.fields(part_of)}
    values = {
        f.name: getattr(reduction, f.name) for f in dataclasses.fields(Reduction) if f.name not in ("elasticity", "cubature")
    }
    part = path.with_name(path.stem + ".part.npz")
    np.savez(part, **parts, **values)
    part.replace(path)


def load(model: RobotModel) -> Reduction | None:
    """Return the model's reduction; None if none is built for its modulus."""
    path = path_of(model)
    if why_not(model) or not path.exists():
        return None
    with np.load(path) as stored:
        values: dict[str, Any] = {name: stored[name].item() if stored[name].ndim == 0 else stored[name] for name in stored.files}
    reduction = Reduction(
        elasticity=StrainPolynomials(**_taken(values, "elasticity_")), cubature=Cubature(**_taken(values, "cubature_")), **values
    )
    covered = reduction.modulus_low * (1 - 1e-9) <= first_modulus(model) <= reduction.modulus_high * (1 + 1e-9)
    return reduction if covered else None


def _taken(values: dict[str, Any], prefix: str) -> dict[str, Any]:
    """Remove the values whose names begin with `prefix`, and return them without it."""
    return {key.removeprefix(prefix): values.pop(key) for key in list(values) if key.startswith(prefix)}
