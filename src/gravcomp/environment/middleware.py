"""How far the nodes' messages reach and by what they travel: environment variables of ROS 2 and Fast DDS."""

from pathlib import Path
from typing import Mapping

_HERE = Path(__file__).parent


def middleware(given: "Mapping[str, str]") -> "dict[str, str]":
    """Return variables to add to the environment `given`.

    Messages stay on this host unless ROS_AUTOMATIC_DISCOVERY_RANGE or ROS_STATIC_PEERS ask for more. Shared memory is not used
    unless the user's FASTDDS_BUILTIN_TRANSPORTS or FASTRTPS_DEFAULT_PROFILES_FILE ask for it.
    """
    reach = {"ROS_AUTOMATIC_DISCOVERY_RANGE": given.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")}
    fast_dds = given.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps")
    if not fast_dds or "FASTRTPS_DEFAULT_PROFILES_FILE" in given:
        return reach
    if reach["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST" and not given.get("ROS_STATIC_PEERS"):
        # The profile itself keeps to this host; rmw_fastrtps leaves it as it is only where the range is the system's.
        return {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(_HERE / "fastdds_loopback.xml"),
        }
    transports = given.get("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    return {
        **reach,
        "FASTDDS_BUILTIN_TRANSPORTS": transports,
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(_HERE / "fastdds_network.xml"),
    }


def reach(given: "Mapping[str, str]") -> str:
    """Return how far messages of a process with this environment reach, as text for the user."""
    if Path(given.get("FASTRTPS_DEFAULT_PROFILES_FILE", "")).name == "fastdds_loopback.xml":
        return "LOCALHOST"
    return given.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
