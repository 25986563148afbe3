"""Check of this machine: Python, ROS, the workspace, CAN interfaces, and programs that only some tasks need."""

import importlib.metadata
import os
import platform
import shutil
import sys
from pathlib import Path

from gravcomp.doctor.finding import Finding
from gravcomp.environment.middleware import reach

_PACKAGES = ("rclpy", "numpy", "scipy", "numba", "python-can", "cantools", "filterpy", "proxsuite", "trimesh", "rosbags", "viser")
_CAN_DEVICE = "280"  # ARPHRD_CAN in /sys/class/net/*/type


def examine() -> list[Finding]:
    """Return the findings about this machine."""
    return [_python(), _ros(), *_packages(), *_executables(), _can(), *_optional()]


def _python() -> Finding:
    return Finding("ok", "Python", f"{platform.python_version()} at {sys.executable}")


def _ros() -> Finding:
    distro = os.environ.get("ROS_DISTRO")
    source = f"installed ROS 2 {distro}" if distro else "ROS 2 Jazzy from wheels"
    return Finding("ok", "ROS", f"{source}; domain {os.environ.get('ROS_DOMAIN_ID', '0')}; discovery {reach(os.environ)}")


def _packages() -> list[Finding]:
    found, missing = [], []
    for name in _PACKAGES:
        try:
            # The wheel of rclpy has another name than the package of an installed ROS.
            distribution = "ros-rclpy" if name == "rclpy" and not os.environ.get("ROS_DISTRO") else name
            found.append(f"{name} {importlib.metadata.version(distribution)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    findings = [Finding("ok", "packages", ", ".join(found))]
    if missing:
        findings.append(Finding("missing", "packages", ", ".join(missing), "rm -rf .venv && ./gravcomp doctor"))
    return findings


def _executables() -> list[Finding]:
    from gravcomp.graph.nodes import NODES
    from gravcomp.launcher.node_process import LaunchError, find_executable

    missing = []
    for entry in NODES:
        try:
            find_executable(entry.package, entry.executable)
        except LaunchError as error:
            missing.append(Finding("missing", entry.executable, str(error), "rm -rf .workspace && ./gravcomp doctor"))
    return missing or [Finding("ok", "nodes", ", ".join(entry.executable for entry in NODES))]


def _can() -> Finding:
    devices = []
    for kind in Path("/sys/class/net").glob("*/type"):
        if kind.read_text(encoding="utf-8").strip() == _CAN_DEVICE:
            devices.append(f"{kind.parent.name} ({(kind.parent / 'operstate').read_text(encoding='utf-8').strip()})")
    if devices:
        return Finding("ok", "CAN", ", ".join(sorted(devices)))
    return Finding(
        "optional", "CAN", "no CAN device (needed for: real hardware)",
        "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100",
    )  # fmt: skip


def _optional() -> list[Finding]:
    findings = []
    for program, use, remedy in (
        ("chromium", "tests of the viewer", "sudo apt-get install -y chromium"),
        ("ccx", "comparison with CalculiX; its results are stored", "sudo apt-get install -y calculix-ccx"),
        ("ros2", "ROS command line; part of a ROS installation", ""),
    ):
        path = shutil.which(program)
        if path:
            findings.append(Finding("ok", program, path))
        else:
            findings.append(Finding("optional", program, f"not installed (needed for: {use})", remedy))
    try:
        importlib.metadata.version("gmsh")
        findings.append(Finding("ok", "gmsh", importlib.metadata.version("gmsh")))
    except importlib.metadata.PackageNotFoundError:
        use = "bodies from surfaces and STEP files"
        findings.append(Finding("optional", "gmsh", f"not installed (needed for: {use})", "./gravcomp mesh install"))
    return findings
