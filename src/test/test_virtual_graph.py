"""The graph of the benchmarks says why no command comes."""

import pytest

from gravcomp.launcher.virtual_graph import last_latched_fault
from gravcomp.motors.state import RECOVERY

NODE = "[WARN] [1796082523.0] [bench_1_2.can_bridge]: "
STOPPED = f"{NODE}fault: the turns of motor 1 (s1c1) could not be counted{RECOVERY}"
REFUSED = f"{NODE}command refused: not following commands: the turns of motor 1 (s1c1) could not be counted{RECOVERY}"


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        ([], ""),
        ([f"{NODE}active: following commands", STOPPED, REFUSED], "the turns of motor 1 (s1c1) could not be counted"),
        ([STOPPED, f"{NODE}holding: waiting for commands"], ""),
        ([f"{NODE}fault: no motor answers: are the C610 powered?"], ""),  # over as soon as they answer
    ],
)
def test_a_fault_is_found_in_which_the_bridge_waits_for_a_user(lines, fault):
    assert last_latched_fault("\n".join(lines)) == fault
