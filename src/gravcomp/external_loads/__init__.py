"""External loads of a running robot: wrenches from a topic and a payload that changes, checked, and ramped."""

from gravcomp.external_loads.live_payload import LivePayload
from gravcomp.external_loads.options import ExternalLoadOptions
from gravcomp.external_loads.wrench_input import WrenchInput

__all__ = ["ExternalLoadOptions", "LivePayload", "WrenchInput"]
