"""Can a robot be held? Whether its cables can keep the tip on a target against gravity, computed before anything is built.

answer = holdability(load_robot_file("article").robot)
print(answer.sentence)

`path` follows the equilibria that keep the tip while gravity grows from zero; `sphere` does so for directions of gravity all over
the sphere; `linear` gives a first answer from the response of the robot at rest.
"""

from gravcomp.holdability.answer import Binding, DirectionAnswer, Holdability, Needed
from gravcomp.holdability.options import HoldOptions
from gravcomp.holdability.sphere import holdability

__all__ = ["Binding", "DirectionAnswer", "HoldOptions", "Holdability", "Needed", "holdability"]
