"""Who serves the bus goes before other sessions, where the user may ask for it, and goes on where not."""

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
    """Of the thread that asked, of one that it starts, and of the session."""
    child = [sys.executable, "-c", CHILD.format(before=before)]
    done = subprocess.run(child, capture_output=True, text=True, check=True, start_new_session=True)
    return [int(number) for number in done.stdout.split()]


@pytest.fixture(autouse=True)
def sessions_are_weighed():
    if not Path("/proc/self/autogroup").exists():
        pytest.skip("this kernel does not weigh sessions against each other")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may ask for precedence")
def test_thread_and_session_go_before_others():
    thread, inherited, session = niceness()
    assert thread == inherited == session < 0


def test_who_may_not_ask_takes_its_turn():
    own = os.getpriority(os.PRIO_PROCESS, 0)  # the child's from its start; other tests may have changed it
    assert niceness("if os.geteuid() == 0: os.setuid(65534)") == [own, own, 0]
