"""Ctrl-C and SIGTERM end a command at any moment."""

import subprocess
import sys

import pytest

_IMPORTS = """
import os, signal, time
from gravcomp.environment.interrupt import run_interruptible

def work():
    import interrupted_in_import
    for _ in range(100):
        time.sleep(0.02)
    return 0

signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
run_interruptible(work)
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    "swallows", ["pass", "raise ImportError('no such library')"], ids=["goes on", "takes it for a missing library"]
)
def test_an_interrupt_in_an_import_that_catches_everything_ends_the_command(number, swallows, tmp_path):
    module = f"""
import os, signal, time
try:
    os.kill(os.getpid(), signal.{number})
    time.sleep(0.05)
except BaseException:
    {swallows}
"""
    (tmp_path / "interrupted_in_import.py").write_text(module, encoding="utf-8")
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{_IMPORTS}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 130, done.stderr
