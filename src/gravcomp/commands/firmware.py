"""`gravcomp firmware`: build, flash and test the firmware of the board, install its tools, write a robot's parameters."""

import argparse
import os
from pathlib import Path

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.commands.parsers import add_subcommand, in_range

_TESTS = tuple(
    f"src/test/test_{name}.py"
    for name in ("firmware", "virtual_board", "standalone", "standalone_board", "model_transfer", "board_laws", "board_heater")
)
_FOLDER = "build/firmware"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommands."""
    parser.description = "The firmware of the board (src/doc/firmware.md)."
    choices = parser.add_subparsers(dest="subcommand", required=True, metavar="SUBCOMMAND")
    add_subcommand(choices, "install", "install the cross compiler and the emulator (480 MB) into a folder of their own")
    build = add_subcommand(choices, "build", "build the image for a board")
    flash = add_subcommand(choices, "flash", "write the image into the board over ST-Link or USB-DFU")
    for parser_ in (build, flash):
        parser_.add_argument("--board", default="stm32f407", choices=("stm32f407",), help="board (default: stm32f407)")
        parser_.add_argument("--standalone", action="store_true", help="with the loop on the board")
        parser_.add_argument("--output", metavar="DIR", default=_FOLDER, help=f"folder of the image (default: {_FOLDER})")
    flash.add_argument("--tool", choices=("pyocd", "openocd", "dfu-util"), help="programme that writes (default: what is there)")
    flash.add_argument("--show", action="store_true", help="print what would be run, and run nothing")
    test = add_subcommand(choices, "test", "run the firmware's tests and the fuzzer; print which lines of the C code they reach")
    test.add_argument(
        "--frames", type=in_range(int, 1, 10**9), default=50_000, metavar="N", help="frames of the fuzzer (default: 50000)"
    )
    test.add_argument("--seed", type=in_range(int, 0, 2**31 - 1), default=1, metavar="N", help="seed of the fuzzer (default: 1)")
    test.add_argument("-k", dest="names", default="", metavar="NAMES", help="only tests with these names, as pytest's -k")
    model = add_subcommand(choices, "model", "turn a robot's reduced model into the blob of the loop on the board")
    model.add_argument("robot", metavar="ROBOT", help="robot file or shipped robot")
    model.add_argument("--output", metavar="DIR", default=_FOLDER, help=f"folder of the blob (default: {_FOLDER})")
    model.add_argument(
        "--joystick-bend",
        type=in_range(float, 1.0, 180.0, "deg"),
        default=60.0,
        metavar="DEG",
        help="bend at full deflection of the joystick (default: 60)",
    )
    send = add_subcommand(
        choices, "send", "send a model to the loop on the board over CAN; the board keeps the old one until it is whole"
    )
    send.add_argument("model", metavar="FILE", help="file that `firmware model` wrote")
    send.add_argument(
        "--forget", action="store_true", help="let the board forget its model first, so that it takes that of another robot"
    )
    send.add_argument("--interface", required=True, help="python-can interface, e.g. socketcan")
    send.add_argument("--channel", required=True, help="channel of the bus, e.g. can0")
    settings = add_subcommand(choices, "parameters", "write a robot's parameters into the board over CAN, and store them")
    settings.add_argument("robot", metavar="ROBOT", help="robot file or shipped robot")
    settings.add_argument("--number", type=int, default=255, metavar="N", help="number of the board (default: the only one)")
    settings.add_argument("--interface", default="", help="python-can interface, e.g. socketcan (default: the robot file's)")
    settings.add_argument("--channel", default="", help="channel of the bus, e.g. can0 (default: the robot file's)")
    settings.add_argument(
        "--standalone",
        action="store_true",
        help="for a robot without a host: the board homes, runs its loop and heats the IMU by itself when its motors answer",
    )
    settings.add_argument(
        "--one-bus", action="store_true", help="the board is on the bus of the motors, not between host and motors"
    )


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0: done, 1: a test failed or the board refused. Raises ConfigError, SetupError."""
    subcommands = {
        "install": _install, "build": _build, "flash": _flash, "test": _test, "model": _model, "send": _send,
        "parameters": _parameters,
    }  # fmt: skip
    return subcommands[args.subcommand](args)


def _install(args: argparse.Namespace) -> int:
    from gravcomp.firmware.toolchain import provide

    folder = provide()
    output.result({"folder": str(folder)}, f"The firmware's tools are in {folder}")
    return 0


def _build(args: argparse.Namespace) -> int:
    figures, sentence = _built(args)
    output.result(figures, sentence)
    return 0


def _built(args: argparse.Namespace) -> tuple[dict, str]:
    from gravcomp.firmware.image import build_image
    from gravcomp.firmware.stack import largest_stack

    folder = made_folder("--output", Path(args.output).expanduser())
    image = build_image(standalone=args.standalone)
    for name, data in (("image.elf", image.path.read_bytes()), ("boot.bin", image.boot), ("code.bin", image.code)):
        (folder / name).write_bytes(data)
    stack = largest_stack(image)
    figures = {
        "board": args.board,
        "standalone": args.standalone,
        "folder": str(folder),
        "check": f"{image.check:08x}",
        "flash_kb": round(image.flash / 1024, 1),
        "ram_kb": round((image.ram + image.ccm) / 1024, 1),
        "stack_kb": round(stack / 1024, 2),
    }
    sentence = (
        f"{folder}/image.elf: {figures['flash_kb']} KB of flash, {figures['ram_kb']} KB of RAM, stack of at most"
        f" {figures['stack_kb']} KB; check {figures['check']}"
    )
    return figures, sentence


def _model(args: argparse.Namespace) -> int:
    import math

    from gravcomp.commands.model.build import prepare
    from gravcomp.description import load_robot_file
    from gravcomp.firmware.model_fit import LONGEST_MS, SLOT_BYTES, fit
    from gravcomp.firmware.model_settings import LoopParameters

    file = load_robot_file(args.robot)
    parameters = LoopParameters.of(file)
    path = made_folder("--output", Path(args.output).expanduser()) / f"{file.robot.name}.model"
    model, reduction, _ = prepare(args.robot)
    found = fit(model, reduction, parameters, math.radians(args.joystick_bend))
    path.write_bytes(found.blob)
    figures = {
        "robot": file.robot.name,
        "blob": str(path),
        "bytes": len(found.blob),
        "slot_bytes": SLOT_BYTES,
        "modes": found.model.size,
        "modes_of_reduced_model": reduction.basis.shape[1],
        "strains": found.strains,
        "multiply_adds": found.multiply_adds,
        "estimated_ms": round(found.milliseconds, 2),
        "error_mm": round(1e3 * found.error, 4),
        "reduction_error_mm": round(1e3 * found.reduction_error, 4),
    }
    sentence = (
        f"{path}: {figures['modes']} of {figures['modes_of_reduced_model']} modes, {found.strains} strains;"
        f" {len(found.blob) / 1024:.0f} of {SLOT_BYTES // 1024} KB of flash; {1e-3 * found.multiply_adds:.0f} thousand"
        f" multiply-adds a step, about {found.milliseconds:.1f} of {LONGEST_MS:g} ms; the tip is up to {1e3 * found.error:.4f} mm"
        " from that of the whole reduced model"
    )
    output.result(figures, sentence)
    return 0


def _send(args: argparse.Namespace) -> int:
    from gravcomp.config import ConfigError
    from gravcomp.description.hardware import CanInterface
    from gravcomp.firmware.client import BoardClient
    from gravcomp.firmware.model_blob import MAGIC
    from gravcomp.firmware.model_transfer import forgetting, sending

    path = Path(args.model).expanduser()
    try:
        blob = path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"{path} cannot be read: {error.strerror}; `./gravcomp firmware model ROBOT` writes such a file"
        ) from None
    if not blob.startswith(MAGIC):
        raise ConfigError(f"{path} is no model for the board; `./gravcomp firmware model ROBOT` writes such a file")
    with BoardClient(CanInterface(args.interface, args.channel)) as client:
        if args.forget:
            client.transfer(forgetting())
        client.transfer(sending(blob))
    output.result({"model": str(path), "bytes": len(blob)}, f"The board uses the model {path}, and keeps it")
    return 0


def _flash(args: argparse.Namespace) -> int:
    import subprocess

    from gravcomp.firmware.flashing import commands_for

    figures, sentence = _built(args)
    output.note(sentence)
    lines = commands_for(Path(args.output).expanduser(), args.tool, needed=not args.show)
    for line in lines:
        output.note(" ".join(line))
        if not args.show and subprocess.run(line).returncode != 0:
            output.result(figures | {"written": False}, "The image was not written: see the message above")
            return 1
    done = "The image was not written: --show" if args.show else "The image is in the board"
    output.result(figures | {"written": not args.show, "commands": [" ".join(line) for line in lines]}, done)
    return 0


def _test(args: argparse.Namespace) -> int:
    from gravcomp.environment.packages import provide_extra
    from gravcomp.firmware.fuzzing import fuzz
    from gravcomp.firmware.line_coverage import measure
    from gravcomp.firmware.static_check import findings
    from gravcomp.firmware.toolchain import provide

    root = Path(os.environ["GRAVCOMP_ROOT"])
    provide_extra("development", root)
    provide()
    found = findings()
    for line in found:
        output.note(line)
    coverage = measure(list(_TESTS), root, args.names)
    for file, lines in coverage.missed.items():
        output.note(f"{file}: not reached: {', '.join(map(str, lines))}")
    fuzzed = fuzz(args.frames, args.seed)
    good = not fuzzed.fault and fuzzed.violations == 0 and not found
    figures = {
        "coverage_pct": coverage.percent, "lines": coverage.lines, "lines_reached": coverage.reached, "frames": fuzzed.frames,
        "violations": fuzzed.violations, "fault": fuzzed.fault, "edges": fuzzed.edges, "findings": len(found),
    }  # fmt: skip
    output.result(
        figures,
        f"Tests passed; clang-tidy finds {len(found)}; {coverage.percent} % of {coverage.lines} lines reached;"
        f" {fuzzed.frames} hostile frames, {fuzzed.violations} violations{', fault: ' + fuzzed.fault if fuzzed.fault else ''}",
    )
    return 0 if good else 1


def _parameters(args: argparse.Namespace) -> int:
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file
    from gravcomp.firmware.client import BoardClient
    from gravcomp.firmware.model_settings import LoopParameters
    from gravcomp.firmware.settings import WITH_HOST, settings_alone, settings_of

    file = load_robot_file(args.robot)
    hardware = file.hardware
    if len(hardware.all_buses) == 1:
        hardware = hardware.on(args.interface, args.channel)
    file.require_motors(hardware.board_bus.interface)
    if args.standalone and hardware.strong_homing:  # the board homes by itself
        raise ConfigError(f"{file.source}: {hardware.strong_homing}")
    settings = settings_of(hardware, between=not args.one_bus)
    settings |= settings_alone(LoopParameters.of(file).estimator.heater) if args.standalone else WITH_HOST
    with BoardClient(hardware.board_bus, args.number) as client:
        client.configure(settings)
    output.result(
        {"board": args.number, "robot": file.source, "parameters": settings}, "The parameters are in the board, and stored"
    )
    return 0
