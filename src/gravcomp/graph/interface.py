"""A node's interface as data: its parameters, topics and services.

Topic and service names are relative to the robot's namespace; a name with ~ is relative to the node; a name with / is absolute.
"""

import importlib
from dataclasses import dataclass

from gravcomp.config import DeclaredParameter, declared_parameters
from gravcomp.graph.parameters.shared import SharedParameters


@dataclass(frozen=True)
class Port:
    """A topic or service: name, type and content with its unit.

    rate: Hz, of a topic with a fixed rate; optional: the port exists in some configurations only.
    """

    name: str
    type: str
    meaning: str
    rate: float | None = None
    optional: bool = False


@dataclass(frozen=True)
class Node:
    """A node: its package and executable, its purpose, and its ports.

    parameters: "module:class" of its data class; tool: a node that observes or operates a graph from outside, on which no other
    node depends.
    """

    package: str
    executable: str
    summary: str
    parameters: str
    subscribes: tuple[Port, ...] = ()
    publishes: tuple[Port, ...] = ()
    services: tuple[Port, ...] = ()
    tool: bool = False

    @property
    def parameters_class(self) -> type:
        """The data class of the node's own parameters."""
        module, name = self.parameters.split(":")
        found: type = getattr(importlib.import_module(module), name)
        return found

    def declared_parameters(self) -> list[DeclaredParameter]:
        """The node's parameters; first those that every node has."""
        return declared_parameters(SharedParameters) + declared_parameters(self.parameters_class)
