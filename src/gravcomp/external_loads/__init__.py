"""External loads of a running robot: wrenches from a topic, a payload that changes, and what turns of the base add to gravity."""

from gravcomp.external_loads.holdable_payload import holdable_payload
from gravcomp.external_loads.live_payload import LivePayload
from gravcomp.external_loads.options import BaseTurnOptions, ExternalLoadOptions
from gravcomp.external_loads.wrench_input import WrenchInput

__all__ = ["BaseTurnOptions", "ExternalLoadOptions", "LivePayload", "WrenchInput", "holdable_payload"]
