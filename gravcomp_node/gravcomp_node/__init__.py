"""Base of all nodes: declared parameters, lifecycle, diagnostics and a clean shutdown.

class Sensor(ManagedNode):
    name = "sensor"
    parameters_class = SensorParameters

    def configure(self): ...      # resources, publishers; raise ConfigError to refuse
    def activate(self): ...       # subscriptions, timers
    def deactivate(self): ...
    def cleanup(self): ...

def main():
    return run(Sensor)
"""

from gravcomp_node.managed_node import ManagedNode
from gravcomp_node.qos import COMMAND, LATCHED, SENSOR
from gravcomp_node.run import run

__all__ = ["COMMAND", "LATCHED", "SENSOR", "ManagedNode", "run"]
