"""ROS domains of runs on one host: each run gets one of its own, as long as there are free ones."""

import subprocess
import sys

from gravcomp.launcher.domain import private_domain, reserve_domain


def test_reserved_domains_differ():
    domains = [reserve_domain() for _ in range(10)]
    assert len(set(domains)) == 10


def test_another_process_gets_another_domain():
    own = {reserve_domain() for _ in range(10)}
    code = "from gravcomp.launcher.domain import reserve_domain; print(*[reserve_domain() for _ in range(10)])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert own.isdisjoint(printed.split())


def test_the_users_domain_is_kept(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert private_domain() == {"ROS_DOMAIN_ID": "42"}
