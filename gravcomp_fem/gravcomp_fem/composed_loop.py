"""The inner nodes of the loop in one process: imu_estimator, fem_simulator and inverse_controller.

They share one executor, and messages between them are not serialised (gravcomp_node.local_topics). To other processes they are
the same three nodes. Bridge and guard stay processes of their own. Parameters and remappings of one node: `-p NODE:NAME:=VALUE`.
"""

import sys

from gravcomp_estimation.imu_estimator import ImuEstimator

from gravcomp_fem.fem_simulator import FemSimulator
from gravcomp_fem.inverse_controller import InverseController
from gravcomp_node import run


def main() -> int:
    """Run the nodes; return the exit code. Those that receive first: nothing is lost when the estimator begins."""
    return run(InverseController, FemSimulator, ImuEstimator)


if __name__ == "__main__":
    sys.exit(main())
