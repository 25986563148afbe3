"""The board's firmware: hostile frames, a dead host, a failed sensor, the build, and the loop with it in the virtual robot.

Everything runs on this machine: the C code under sanitizers, and the image in an emulator. Nothing here has run on a chip.
"""

import time
from collections.abc import Callable

from gravcomp.bench import board_standalone
from gravcomp.canbus import c610
from gravcomp.canbus.codec import encode
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import load_robot_file
from gravcomp.description.hardware import Hardware
from gravcomp.firmware.campaign import attack
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.fuzzing import fuzz
from gravcomp.firmware.host_board import MOTOR_BUS, HostBoard
from gravcomp.firmware.image import build_image
from gravcomp.firmware.settings import settings_of
from gravcomp.firmware.stack import largest_stack
from gravcomp.graph.boards import BOARDS
from gravcomp.trials.turning_base import residuals

_AMPERES = 0.5  # of the host before it dies, where the robot's limit allows that
_PHASES = (0, 1, 2, 3, 7)  # ms, at which the host dies or the sensor fails, against the board's ticks and samples
_LONGEST_HEAT = 3000  # ms
_ORIENTATIONS = 10  # random ones of the loop with each board, in addition to the five poses
_START = 300  # ms until the image has set the sensor up


def run(progress: Callable[[str], None], *, frames: int = 200_000, seed: int = 1, every: int = 1) -> dict:
    """Return the figures; the names of the keys give their units.

    frames: hostile frames and samples at each of the image and the C code; every: only every so many phases, and for more than
    one no loop, and of the images only the one with the loop on the board is built again.
    """
    file = load_robot_file("article")
    hardware = file.hardware
    build_s, identical = _built_again(progress, every)
    image = build_image()
    progress("hostile frames at the C code under sanitizers")
    fuzzed = fuzz(frames, seed)
    progress("hostile frames at the emulated image")
    attacked = attack(frames, seed)
    progress("dead hosts and failed sensors")
    phases = _PHASES[::every]
    makers: tuple[Callable[[dict[str, float]], HostBoard | ImageBoard], ...] = (HostBoard, ImageBoard)
    dead = [_dead_host(make(settings_of(hardware, between=True)), hardware, p) for make in makers for p in phases]
    heat = [_failed_sensor(make({}), p, wrong) for make in makers for p in phases for wrong in ("silent", "implausible")]
    return {
        "robot": file.robot.name,
        "board_frames": min(fuzzed.frames + fuzzed.samples, attacked.frames + attacked.samples),
        "board_violations": fuzzed.violations + attacked.violations,
        "board_faults": bool(fuzzed.fault) + len(attacked.faults),
        "fault_list": [*([fuzzed.fault] if fuzzed.fault else []), *attacked.faults],
        "image_differences": attacked.differences,
        "branches_reached": fuzzed.edges,
        "dead_host_ms": max(dead),
        "heater_off_s": round(1e-3 * max(heat), 3),
        "build_s": round(build_s, 1),
        "image_identical": identical,
        "image_flash_kb": round(image.flash / 1024, 1),
        "image_ram_kb": round((image.ram + image.ccm) / 1024, 1),
        "image_stack_kb": round(largest_stack(image) / 1024, 2),
        **(_loop(progress) if every == 1 else {}),
        **board_standalone.run(progress, every=every),
    }


def _built_again(progress: Callable[[str], None], every: int) -> tuple[float, bool]:
    """Return the longest time (s) to build an image, and whether each image is the same again."""
    longest, identical = 0.0, True
    for standalone in (False, True) if every == 1 else (True,):
        progress(f"building the image again{', with the loop on the board' if standalone else ''}")
        first = build_image(standalone=standalone).path.read_bytes()
        begin = time.monotonic()
        again = build_image(standalone=standalone, fresh=True)
        longest = max(longest, time.monotonic() - begin)
        identical = identical and again.path.read_bytes() == first
    return longest, identical


def _loop(progress: Callable[[str], None]) -> dict:
    """Return the lateral residuals at rest and turning with each board, and how much more they are than the Python board's in %.

    `residual_pct`: at rest and turning; `*_residual_pct`: the worse of both. With the five poses alone four turns would decide:
    at some of them the cables stick longer with one board than with another.
    """
    found = {}
    for board in BOARDS:
        progress(f"the loop with the {board} board")
        of = residuals(Setup.of(load_robot_file("article")), _ORIENTATIONS, board=board)
        found[board] = {"held": 1e3 * of.held, "moving": 1e3 * of.moving}
    more = {
        board: {kind: round(100.0 * (found[board][kind] / found["virtual"][kind] - 1.0), 2) for kind in found[board]}
        for board in BOARDS[1:]
    }
    return {
        "lateral_mm": {board: {kind: round(value, 4) for kind, value in of.items()} for board, of in found.items()},
        "residual_pct": more,
        **{f"{board}_residual_pct": max(of.values()) for board, of in more.items()},
    }


def _dead_host(board: HostBoard | ImageBoard, hardware: Hardware, phase: int) -> int:
    """Return the ms from the last currents of a host until the motors get zero and nothing else any more."""
    currents = {m.can_id: min(_AMPERES, hardware.drive.current_limit) for m in hardware.motors}
    end, released = 400 + phase, None
    for now in range(1, end + 200):
        if now <= end and (end - now) % 4 == 0:
            board.receive(c610.command("MotorCommand1to4", currents))
        if now % 2 == 0:
            for motor in hardware.motors:
                board.receive(c610.feedback(motor.can_id, 1000, 0, 0.0), MOTOR_BUS)
        board.advance(1000 * now)
        for frame in board.sent(MOTOR_BUS):
            if frame.arbitration_id in c610.COMMAND_IDS:
                released = None if any(frame.data) else released or now
        board.sent()
    return 1000 if released is None else released - end


def _failed_sensor(board: HostBoard | ImageBoard, phase: int, wrong: str) -> int:
    """Return the ms from the failure of the sensor until the heater is off, although the host commands half of its power."""
    fails, temperature = _START + 400 + phase, 0
    for now in range(1, fails + _LONGEST_HEAT):
        if now == fails:
            temperature = -1024 if wrong == "implausible" else temperature
        if now % 10 == 0 and (now < fails or wrong == "implausible"):
            board.sample((0, 0, 5460, 0, 0, 0), temperature, 1000 * now)
        if now % 100 == 0:
            board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
        board.advance(1000 * now)
        board.sent()
        if now >= fails and board.duty == 0.0:
            return now - fails
    return _LONGEST_HEAT
