"""The article's experiments, one module per experiment with `TITLE` and `run(context) -> Result`.

EXPERIMENTS lists them in the order of the article; a module is imported when its experiment runs.
`measured` is a package for measurements of other authors, which the user provides.
`gravcomp.evaluation.recorded` evaluates a bag of your own robot by the same measures.
"""

from importlib import import_module
from types import ModuleType

EXPERIMENTS = {
    "imu-ablation": "yaw drift with and without EKF and heating, at rest and at 23 deg/s",
    "tuning": "the article's grid of 25 pairs of modulus and damping, against calibration",
    "real2sim": "free fall from straight at five inclinations, model against robot",
    "deflection": "sag against Euler-Bernoulli, the elastica, linear tetrahedra and a general FEM",
    "static": "compensation at several poses, straight and bent",
    "long-segment": "static compensation with a distal segment of 80 mm, only the geometry changed",
    "arm": "five poses on an arm, two passes of 90 s, straight and bent by 30 deg",
    "hand-held": "reaching through a straight and a curved lumen, held by a hand with tremor",
    "colonoscopy": "reaching into a colon, patient supine and left lateral",
    "delay": "latency from gravity to motor current, its cost, and the effect of prediction",
}

ALSO = {"freefall": "real2sim", "segments": "long-segment"}
"""Other names of experiments."""

MEASURED = "the model against what others measured, in the folder DATA"


def experiment(name: str) -> ModuleType:
    """Return the module of an experiment."""
    return import_module(f"gravcomp.experiments.{name.replace('-', '_')}")
