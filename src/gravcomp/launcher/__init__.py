"""The graph as processes: starts the nodes, watches them, and ends them with everything that they started.

with Graph([NodeSpec("gravcomp_fem", "fem_simulator", parameters={"robot": "article"})]) as graph:
    graph.start()
    while graph.watch() is None: ...
"""

from gravcomp.launcher.graph import Graph, NodeDied
from gravcomp.launcher.node_process import LaunchError, NodeProcess, NodeSpec

__all__ = ["Graph", "LaunchError", "NodeDied", "NodeProcess", "NodeSpec"]
