"""Node viewer: serves the live 3D page of a robot, and sends the user's requests on the page as messages and service calls.

The node runs in its own process and reads only the newest message of each topic at the page's rate, so that the loop is not
affected. No node of the loop depends on it.
"""

import sys
from typing import TYPE_CHECKING

from gravcomp_node.managed_node import OK, WARN

from gravcomp.graph.parameters.viewer import ViewerParameters
from gravcomp.view.page import Page
from gravcomp_fem.viewer_observer import GraphObserver
from gravcomp_fem.viewer_requests import RequestSender
from gravcomp_node import ManagedNode, run

if TYPE_CHECKING:
    from gravcomp.scene.scene import Scene
    from gravcomp.view.obstacle_shapes import ObstacleShape


class Viewer(ManagedNode):
    """Shows the robot in a browser."""

    name = "viewer"
    parameters_class = ViewerParameters

    def configure(self) -> None:
        """Start to serve the page; create publishers and clients."""
        self._walls, shapes = self._surroundings()
        self._page = Page(self.robot_file.robot, self.parameters, shapes)
        bridge = "joint_bridge" if self.robot_file.has_joints else "can_bridge"
        self.sender = RequestSender(self, self.parameters, self.robot_file.robot.length, self._page.notify, bridge)
        self.get_logger().info(f"the page is at {self._page.address}")

    def _surroundings(self) -> "tuple[Scene | None, list[ObstacleShape]]":
        """Return the walls and the obstacles to draw. Raises ConfigError for a file of the scene that cannot be read."""
        if not self.robot_file.section("scene"):
            return None, []
        from gravcomp.view.obstacle_shapes import obstacle_shapes  # imports Numba

        walls, length = self.robot_file.scene, self.robot_file.robot.length
        return walls, obstacle_shapes(walls, length) + obstacle_shapes(self.robot_file.zones, length, forbidden=True)

    def activate(self) -> None:
        """Subscribe, and update the page from now on."""
        self.observer = GraphObserver(self, self.robot_file.robot, self._walls)
        self._frames = self.create_timer(1.0 / self.parameters.rate, self._frame)

    def deactivate(self) -> None:
        """Stop updating the page, end a recording, and unsubscribe."""
        self.destroy_timer(self._frames)
        self.sender.stop_recording()
        self.observer.destroy()

    def cleanup(self) -> None:
        """Close the page."""
        if not hasattr(self, "_page"):
            return
        self._page.close()
        del self._page
        self.sender.destroy()

    def _frame(self) -> None:
        """Send the user's requests and show the current state."""
        for request in self._page.requests():
            self.sender.send(request)
        self.observer.read()
        self._page.show(self.observer.snapshot(recording=self.sender.current_bag()))
        address, misfit = f"the page is at {self._page.address}", self.observer.misfit
        self.report(WARN if misfit else OK, f"{address}; {misfit}" if misfit else address, browsers=self._page.clients)


def main() -> int:
    """Run the node; return the exit code."""
    return run(Viewer)


if __name__ == "__main__":
    sys.exit(main())
