"""A ROS domain of its own, so that a demo never speaks to a robot that runs on the same machine."""

import os
import random

# Above 101 the ports of a domain may meet those that Linux hands out by itself.
_DOMAINS = range(1, 100)


def private_domain() -> dict[str, str]:
    """The environment variable ROS_DOMAIN_ID: the user's where it is set, otherwise one by chance."""
    given = os.environ.get("ROS_DOMAIN_ID")
    return {"ROS_DOMAIN_ID": given or str(random.SystemRandom().choice(_DOMAINS))}
