"""What inverse_controller takes from one deformation of the model: from its message, or from the shape itself.

In a composed process the simulator publishes the shape as a value (gravcomp_node.local_topics.Adapted), and nothing is converted.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from std_msgs.msg import Header

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.simulation import Response, Shape
from gravcomp_fem.conversion import check_compliance, contact_of, deformation_message, gravity_of, response_of, vector_of
from gravcomp_msgs.msg import Deformation


@dataclass(frozen=True)
class PublishedShape:
    """A shape with the header of its message: stamp of the IMU sample, and base frame.

    turn (3,) m/s^2: what a turning base adds to gravity in the shape's load.
    """

    shape: Shape
    header: Header
    turn: np.ndarray

    @property
    def gravity(self) -> np.ndarray:
        """Gravity alone (3,) in m/s^2."""
        return self.shape.gravity - self.turn

    def message(self) -> Deformation:
        """Return the message for those who need one."""
        return deformation_message(self.shape, self.header, self.turn)


@dataclass(frozen=True)
class Deformed:
    """m cables, p stations of the backbone; in soft_base.

    status: one of Deformation's; tip_position (3,) in m; tip_orientation (4,) x y z w; backbone_station (p,) 0..1; cable_tension
    (m,) in N; gravity (3,) in m/s^2, without what a turning base adds.
    """

    header: Header
    status: int
    tip_position: np.ndarray
    tip_orientation: np.ndarray
    backbone_station: np.ndarray
    cable_tension: np.ndarray
    gravity: np.ndarray
    response: Response
    contact: ObstacleForces


def from_message(message: Deformation) -> Deformed:
    """Return what is in a message. Raises ValueError for arrays that do not match or numbers that are not finite."""
    response, contact, gravity = response_of(message), contact_of(message), gravity_of(message)
    q = message.tip.orientation
    return Deformed(
        header=message.header,
        status=message.status,
        tip_position=vector_of(message.tip.position),
        tip_orientation=np.array([q.x, q.y, q.z, q.w]),
        backbone_station=np.array(message.backbone_station),
        cable_tension=np.array(message.cable_tension),
        gravity=gravity,
        response=response,
        contact=contact,
    )


def from_shape(published: PublishedShape) -> Deformed:
    """Return what is in a shape of this process. Raises ValueError for the numbers for which `from_message` does."""
    shape = published.shape
    response, contact = shape.response, shape.contacts.by_obstacle()
    numbers = {field.name: getattr(response, field.name) for field in dataclasses.fields(response)}
    numbers |= {"gravity": published.gravity, "cable_tension": shape.cable_tension}
    numbers |= {"contact_force": contact.force, "contact_position": contact.position, "contact_force_change": contact.change}
    # One look at all of them: this is on the way from sample to command.
    if not np.isfinite(np.concatenate([values.ravel() for values in numbers.values()])).all():
        wrong = next(name for name, values in numbers.items() if not np.isfinite(values).all())
        raise ValueError(f"{wrong} has numbers that are not finite")
    check_compliance(response)
    return Deformed(
        header=published.header,
        status=int(shape.status),
        tip_position=shape.tip_position,
        tip_orientation=shape.tip_orientation,
        backbone_station=shape.backbone_station,
        cable_tension=shape.cable_tension,
        gravity=published.gravity,
        response=response,
        contact=contact,
    )
