"""The finite-element model of a robot as it is described: where it has no `elements`, with the mesh that `mesh_choice` finds."""

from gravcomp.description import Robot
from gravcomp.full_model.chosen_elements import with_chosen_elements
from gravcomp.full_model.model import MeshedModel
from gravcomp.mesh import Mesh


class RobotModel(MeshedModel):
    """The finite-element model of a robot."""

    def __init__(self, robot: Robot, mesh: Mesh | None = None):
        """Build the model; `mesh` replaces the mesh of the robot's description.

        Raises MeshError for a body that cannot be meshed, a cable outside the body and parts that are not connected to the base.
        """
        super().__init__(robot if mesh else with_chosen_elements(robot), mesh)
