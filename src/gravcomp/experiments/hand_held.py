"""A hand with tremor reaches through a straight and a curved lumen."""

import numpy as np

from gravcomp.experiments.reaching import reaching
from gravcomp.experiments.steering import add_steering
from gravcomp.report.result import Result
from gravcomp.trials.context import Context
from gravcomp.trials.lumen import Lumen, Reach

TITLE = "Hand-held, through lumens"

REACHES = (
    Reach(
        "straight lumen",
        Lumen(0.2, 0.0, 0.0, 22e-3),
        inclination=0.0,
        roll=0.0,
        first=0.0,
        last=0.1,
        duration=20.0,
        hand=True,
    ),
    Reach(
        "curved lumen",
        Lumen(0.04, 0.09, np.radians(60.0), 24e-3),
        inclination=10.0,
        roll=0.0,
        first=0.0,
        last=0.1,
        duration=20.0,
        hand=True,
    ),
)


def run(context: Context) -> Result:
    """Run the experiment."""
    question = "Can a user reach through a tube without touching it, straight and around a bend?"
    result = reaching(context, "hand-held", TITLE, question, REACHES)
    add_steering(result, context, REACHES)
    return result
