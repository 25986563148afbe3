"""The article's experiments, one module each with `TITLE` and `run(context) -> Result`; `loop` is the closed loop that they share, and
`recorded` judges a bag of one's own robot by the same measures.

EXPERIMENTS names them in the order of the article; nothing is imported before it is run.
"""

from importlib import import_module
from types import ModuleType

EXPERIMENTS = {
    "imu-ablation": "drift of the orientation with and without EKF and heating, at rest and at 23 deg/s",
    "tuning": "the article's grid of 25 pairs of modulus and damping, and the calibration that replaces it",
    "real2sim": "free fall from straight at five inclinations, model against robot over time",
    "deflection": "sag against Euler-Bernoulli, the elastica, linear tetrahedra and a general FEM",
    "static": "compensation at several poses, straight and bent",
    "long-segment": "the same with a distal segment of 80 mm, only the geometry changed",
    "arm": "five poses, two passes of 90 s, straight and bent by 30 deg",
    "hand-held": "reaching through straight and curved lumens in a trembling hand",
    "colonoscopy": "along a colon, supine and left lateral",
    "delay": "how late the robot answers to gravity, and what prediction buys",
}


def experiment(name: str) -> ModuleType:
    """The module of an experiment."""
    return import_module(f"gravcomp.experiments.{name.replace('-', '_')}")
