"""Processes that serve the bus raise their priority if the user has the right to; otherwise they run as usual."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CHILD = """
import os, threading
from gravcomp.canbus.precedence import take_precedence
{before}
take_precedence()
inherited = []
thread = threading.Thread(target=lambda: inherited.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))
thread.start(); thread.join()
print(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()), inherited[0], open("/proc/self/autogroup").read().split()[-1])
"""


def niceness(before: str = "") -> list[int]:
    """Return the niceness of the calling thread, of one that it starts, and of the session."""
    child = [sys.executable, "-c", CHILD.format(before=before)]
    done = subprocess.run(child, capture_output=True, text=True, check=True, start_new_session=True)
    return [int(number) for number in done.stdout.split()]


@pytest.fixture(autouse=True)
def sessions_have_priorities():
    if not Path("/proc/self/autogroup").exists():
        pytest.skip("this kernel has no priorities of sessions (autogroups)")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root has the right to raise the priority")
def test_thread_and_session_get_a_higher_priority():
    thread, inherited, session = niceness()
    assert thread == inherited == session < 0


def test_without_the_right_the_priority_stays():
    own = os.getpriority(os.PRIO_PROCESS, 0)  # the child starts with it; other tests may have changed it
    assert niceness("if os.geteuid() == 0: os.setuid(65534)") == [own, own, 0]
