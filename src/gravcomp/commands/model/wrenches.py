"""`--wrench`: external forces and moments as text on the command line."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gravcomp.full_model.wrench import Wrench

_FRAMES = ("fixed", "follower")
# A wrench beyond this is a slip of the unit: the softest and the stiffest robots that can be described break far below.
_LARGEST_FORCE, _LARGEST_MOMENT = 1e4, 1e4  # N, N m


def add_wrench_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the external wrenches."""
    parser.add_argument(
        "--wrench", nargs="+", action="append", default=[], metavar="N",
        help="external force FX FY FZ (N) and moment MX MY MZ (N m, default 0) on a section; may be given several times",
    )  # fmt: skip
    parser.add_argument(
        "--wrench-at", type=float, action="append", default=[], metavar="STATION",
        help="section of the wrench with the same number: 0 at the base to 1 at the tip (default 1)",
    )  # fmt: skip
    parser.add_argument(
        "--wrench-frame", choices=_FRAMES, action="append", default=[],
        help="fixed: axes of soft_base, constant (default); follower: axes of the section, turning with it",
    )  # fmt: skip


def wrenches_of(args: argparse.Namespace) -> "tuple[Wrench, ...]":
    """Return the wrenches of the arguments. Raises ValueError for those that cannot be used."""
    import numpy as np

    from gravcomp.full_model.wrench import Wrench

    for name, given in (("--wrench-at", args.wrench_at), ("--wrench-frame", args.wrench_frame)):
        if len(given) > len(args.wrench):
            raise ValueError(f"{name} is given {len(given)} times and --wrench {len(args.wrench)} times: one for each at most")
    found = []
    for number, texts in enumerate(args.wrench):
        values = [_number(text) for text in texts]
        if len(values) not in (3, 6):
            raise ValueError(f"--wrench has {len(values)} numbers; 3 (a force in N) or 6 (with a moment in N m) are needed")
        force, moment = values[:3], values[3:] or [0.0, 0.0, 0.0]
        for unit, part, largest in (("N", force, _LARGEST_FORCE), ("N m", moment, _LARGEST_MOMENT)):
            if not sum(value**2 for value in part) < largest**2:
                raise ValueError(f"--wrench has {', '.join(f'{v:g}' for v in part)} {unit}; below {largest:g} {unit} is allowed")
        station = args.wrench_at[number] if number < len(args.wrench_at) else 1.0
        if not 0.0 <= station <= 1.0:
            raise ValueError(f"--wrench-at is {station:g}; allowed: 0 at the base to 1 at the tip")
        frame = args.wrench_frame[number] if number < len(args.wrench_frame) else "fixed"
        found.append(Wrench(np.array(force), np.array(moment), station, follower=frame == "follower"))
    return tuple(found)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"--wrench has '{text}'; numbers are needed") from None
