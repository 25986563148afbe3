"""From the rectum into the first bend of the colon, patient supine and left lateral: the same path in the body, another gravity.

Rectum: 40 mm straight; bend: 70 mm radius towards the front of the patient; lumen 30 mm. The frame turns with the patient.
"""

import numpy as np

from gravcomp.experiments.reaching import reaching
from gravcomp.experiments.steering import add_steering
from gravcomp.report.result import Result
from gravcomp.trials.context import Context
from gravcomp.trials.lumen import Lumen, Reach

TITLE = "Colonoscopy, supine and left lateral"

_COLON = Lumen(inlet=0.04, radius=0.07, plane=np.radians(0.0), diameter=30e-3)

REACHES = tuple(
    Reach(name, _COLON, inclination=0.0, roll=roll, first=0.0, last=0.1, duration=20.0, hand=True)
    for name, roll in (("supine", 0.0), ("left lateral", 90.0))
)


def run(context: Context) -> Result:
    """Run the experiment."""
    question = "Does the robot follow the same path through the colon when the patient is turned on the side?"
    result = reaching(context, "colonoscopy", TITLE, question, REACHES)
    add_steering(result, context, REACHES)
    return result
