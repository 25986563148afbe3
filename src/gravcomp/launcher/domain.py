"""ROS domains that no other run on this host uses, so that a demo does not reach a robot on the same machine."""

import os
import random
import socket

# Above 101 the ports of a domain overlap the range of ports that Linux assigns.
_DOMAINS = range(1, 100)

_RESERVED: list[socket.socket] = []  # the names of the domains that this process holds


def private_domain() -> dict[str, str]:
    """Return the environment variable ROS_DOMAIN_ID: the user's if it is set, else a domain that this process reserves."""
    given = os.environ.get("ROS_DOMAIN_ID")
    return {"ROS_DOMAIN_ID": given or reserve_domain()}


def reserve_domain() -> str:
    """Return a domain that no other process of this host has reserved; it stays reserved until this process ends.

    The reservation is an abstract Unix socket, which the kernel releases even when the process is killed. With all domains
    reserved, one is chosen at random.
    """
    domains = random.SystemRandom().sample(_DOMAINS, len(_DOMAINS))
    for domain in domains:
        name = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            name.bind(f"\0gravcomp-ros-domain-{domain}")
        except OSError:
            name.close()
            continue
        _RESERVED.append(name)
        return str(domain)
    return str(domains[0])
