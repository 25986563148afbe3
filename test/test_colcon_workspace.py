"""The repository in a user's colcon workspace, next to a package that is not ours: it builds, is found and is tested."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gravcomp.environment.packages import tools_folder

ROOT = Path(__file__).resolve().parents[1]
OWN = ("gravcomp", "gravcomp_msgs", "gravcomp_node", "gravcomp_hw", "gravcomp_estimation", "gravcomp_fem")
FOLDERS = ("src", *OWN[1:])
FOREIGN = "neighbour"
SHOWN = 4000  # characters of a failed command's output
ROS = os.environ.get("ROS_DISTRO")
TOOLS = tools_folder(ROOT)  # colcon and CMake, where no ROS 2 is sourced
# One cheap module of our tests, and that of the foreign package.
CHEAP = f"test_status.py or test_{FOREIGN}.py"

pytestmark = [
    pytest.mark.timeout(300),
    pytest.mark.skipif(not (ROS or (TOOLS / "bin" / "colcon").exists() or shutil.which("colcon")), reason="it needs colcon"),
]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A built workspace: a copy of the repository and a foreign ament_python package that depends on our messages."""
    base = tmp_path_factory.mktemp("workspace")
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info", ".*")
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, base / "src" / "gravcomp" / folder, ignore=unwanted)
    _write_foreign_package(base / "src" / FOREIGN)
    colcon(base, "build", "--event-handlers", "console_direct-")
    return base


def _write_foreign_package(folder: Path) -> None:
    files = {
        "package.xml": f"""<package format="3">
            <name>{FOREIGN}</name><version>1.0.0</version><description>A package of the user's.</description>
            <maintainer email="user@example.com">user</maintainer><license>MIT</license>
            <exec_depend>gravcomp_msgs</exec_depend><test_depend>python3-pytest</test_depend>
            <export><build_type>ament_python</build_type></export></package>""",
        "setup.py": f"""from setuptools import setup
setup(name="{FOREIGN}", version="1.0.0", packages=["{FOREIGN}"], extras_require={{"test": ["pytest"]}},
      data_files=[("share/ament_index/resource_index/packages", ["resource/{FOREIGN}"]), ("share/{FOREIGN}", ["package.xml"])])
""",
        f"resource/{FOREIGN}": "",
        f"{FOREIGN}/__init__.py": "",
        f"test/test_{FOREIGN}.py": """from gravcomp_msgs.msg import CableCommand


def test_neighbour_uses_our_message():
    assert list(CableCommand(displacement=[0.001]).displacement) == [0.001]
""",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def _environment() -> dict[str, str]:
    """The environment of a user who has sourced ROS 2 and no workspace of ours."""
    ours = ("COLCON_", "AMENT_", "GRAVCOMP_", "_ROS_WHEELS")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(ours)}
    for name in ("PYTHONPATH", "LD_LIBRARY_PATH"):
        environment.pop(name, None)
    if ROS:
        installed = f"/opt/ros/{ROS}"
        # The locked packages are in .venv, which the system's colcon does not know.
        python_path = ":".join(entry for entry in sys.path if "/.venv/" in entry or entry.startswith("/opt/ros"))
        return environment | {
            "AMENT_PREFIX_PATH": installed,
            "CMAKE_PREFIX_PATH": installed,
            "LD_LIBRARY_PATH": f"{installed}/lib",
            "PYTHONPATH": python_path,
        }
    prefix = sys.prefix
    return environment | {
        "PATH": f"{prefix}/bin:{TOOLS}/bin:{environment['PATH']}",
        "PYTHONPATH": str(TOOLS),
        "AMENT_PREFIX_PATH": prefix,
        "CMAKE_PREFIX_PATH": prefix,
        "CMAKE_GENERATOR": "Ninja",
    }


def shell(base: Path, line: str) -> str:
    """Run a line of bash in the workspace; its output. Fails with the output's end."""
    done = subprocess.run(["bash", "-c", line], cwd=base, env=_environment(), capture_output=True, text=True)
    assert done.returncode == 0, f"{line}\n{(done.stdout + done.stderr)[-SHOWN:]}"
    return done.stdout


def colcon(base: Path, *arguments: str) -> str:
    # By the Python of the environment, which colcon writes into the nodes' scripts.
    own = TOOLS / "bin" / "colcon"
    return shell(base, shlex.join(([sys.executable, str(own)] if own.exists() and not ROS else ["colcon"]) + list(arguments)))


def test_every_package_is_built_and_found(workspace):
    found = shell(workspace, "source install/setup.bash && echo $AMENT_PREFIX_PATH").strip().split(":")
    assert {*OWN, FOREIGN} <= {Path(prefix).name for prefix in found}


def test_a_node_starts_from_the_workspace(workspace):
    answer = shell(workspace, "source install/setup.bash && install/gravcomp_hw/lib/gravcomp_hw/can_bridge --help")
    assert "can_bridge: a node of gravcomp" in answer and "interface" in answer


def test_the_tests_of_both_run(workspace):
    colcon(workspace, "test", "--packages-select", "gravcomp_estimation", FOREIGN, "--return-code-on-test-failure",
           "--pytest-args", "-k", CHEAP)  # fmt: skip
    summary = colcon(workspace, "test-result", "--all")
    ran = {Path(path).parent.name: int(count) for path, count in re.findall(r"^(\S+): (\d+) tests?,", summary, re.MULTILINE)}
    assert ran[FOREIGN] == 1 and ran["gravcomp_estimation"] > 1, summary


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_release_carries_the_licence(folder):
    # Bloom releases a package's folder alone, so a link to the repository's file would lead nowhere.
    assert not (ROOT / folder / "LICENSE").is_symlink()
    assert (ROOT / folder / "LICENSE").read_text(encoding="utf-8") == (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert '<license file="LICENSE">Apache-2.0</license>' in (ROOT / folder / "package.xml").read_text(encoding="utf-8")
