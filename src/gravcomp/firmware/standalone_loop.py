"""The loop on the board, as C code in this process: samples or gravity in, commands out (boards/host/loop.h)."""

import ctypes
import dataclasses
from collections.abc import Sequence

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.firmware.host_library import load
from gravcomp.firmware.model_settings import CABLES_MAX

REFUSALS = (
    "", "it is cut off", "it is no blob of a model", "it is of another version of the firmware",
    "it has more modes, strains, cables, pieces of cables, points or branches than the firmware has room for",
    "its size is not that of its tables", "its CRC is wrong", "it belongs to another robot", "it has a number that is not finite",
)  # fmt: skip
"""Why the firmware refuses a blob, by gc_model_status of standalone/model.h; the first is that of a blob that is taken."""


class RawResult(ctypes.Structure):
    """`gc_loop_result` of boards/host/loop.h."""

    _fields_ = (
        ("gravity", ctypes.c_float * 3),
        ("turning", ctypes.c_float * 3),
        ("tip", ctypes.c_float * 3),
        ("displacement", ctypes.c_float * CABLES_MAX),
        ("tension", ctypes.c_float * CABLES_MAX),
        ("left", ctypes.c_float),
        ("code", ctypes.c_uint32),
        ("converged", ctypes.c_uint32),
        ("solver_steps", ctypes.c_uint32),
        ("cables", ctypes.c_uint32),
    )


@dataclasses.dataclass(frozen=True)
class LoopResult:
    """What the loop computed.

    gravity (3,) and turning (3,), what turns of the base add, in m/s^2, and tip (3,) in m, all in soft_base; displacement (m,) in
    m and tension (m,) in N of the command; left: estimated distance of the model's tip from its equilibrium in m; code: of
    gravcomp_msgs/ControllerStatus; solver_steps: of the quadratic programme.
    """

    gravity: np.ndarray
    turning: np.ndarray
    tip: np.ndarray
    displacement: np.ndarray
    tension: np.ndarray
    left: float
    code: int
    converged: bool
    solver_steps: int

    @classmethod
    def of(cls, raw: RawResult) -> "LoopResult":
        """Return what the C code says."""
        m = raw.cables
        return cls(
            gravity=np.array(raw.gravity, dtype=float),
            turning=np.array(raw.turning, dtype=float),
            tip=np.array(raw.tip, dtype=float),
            displacement=np.array(raw.displacement[:m], dtype=float),
            tension=np.array(raw.tension[:m], dtype=float),
            left=raw.left,
            code=raw.code,
            converged=bool(raw.converged),
            solver_steps=raw.solver_steps,
        )


class StandaloneLoop:
    """One loop with its model. Raises SetupError without a compiler, ConfigError for a blob that the firmware refuses."""

    def __init__(self, blob: bytes):
        library = load()
        memory, floats = ctypes.c_void_p, ctypes.POINTER(ctypes.c_float)
        for name, result, arguments in (
            ("size", ctypes.c_size_t, ()),
            ("settings", ctypes.c_size_t, ()),
            ("load", ctypes.c_uint32, (memory, memory, ctypes.c_size_t)),
            ("weigh", ctypes.c_bool, (memory, ctypes.c_int64, floats, floats)),
            ("follow", ctypes.c_bool, (memory, floats, ctypes.c_float)),
            ("joystick", None, (memory, ctypes.c_float, ctypes.c_float)),
            ("read", None, (memory, ctypes.POINTER(RawResult))),
        ):
            function = getattr(library, f"gc_loop_{name}")
            function.restype, function.argtypes = result, arguments
        self._library = library
        self._memory = (ctypes.c_uint64 * (library.gc_loop_size() // 8 + 1))()
        self._at = ctypes.addressof(self._memory)
        self._result = RawResult()
        refusal = self.load(blob)
        if refusal:
            raise ConfigError(f"the firmware refuses the model: {refusal}")

    def load(self, blob: bytes) -> str:
        """Take another model and start again; return why it is refused, empty: it is taken. What was there before goes on."""
        memory = (ctypes.c_uint32 * (len(blob) // 4 + 1))()
        ctypes.memmove(memory, blob, len(blob))
        status = self._library.gc_loop_load(self._at, ctypes.addressof(memory), len(blob))
        if status == 0:
            self._blob = memory  # the firmware reads it in place
        return REFUSALS[status]

    def weigh(self, stamp_us: int, gyro: Sequence[float], accel: Sequence[float]) -> bool:
        """Estimate gravity from a raw sample, gyro (3,) in rad/s and accel (3,) in m/s^2; return whether it can be used."""
        return self._library.gc_loop_weigh(self._at, stamp_us, _floats(gyro), _floats(accel))

    def follow(self, interval: float, gravity: Sequence[float] | None = None) -> bool:
        """Go to the estimated gravity with what turns of the base add, `interval` s after the last step.

        gravity (3,) in m/s^2: in place of these. Returns whether there is a command.
        """
        return self._library.gc_loop_follow(self._at, None if gravity is None else _floats(gravity), interval)

    def steer(self, x: float, y: float) -> None:
        """Bend toward (x, y), each from -1 to 1, in place of the stored target."""
        self._library.gc_loop_joystick(self._at, x, y)

    @property
    def address(self) -> int:
        """Where the loop's state is in memory."""
        return self._at

    @property
    def gravity(self) -> np.ndarray:
        """The estimated gravity (3,) in m/s^2 in soft_base."""
        self._library.gc_loop_read(self._at, self._result)
        return np.array(self._result.gravity, dtype=float)

    def read(self) -> LoopResult:
        """Return the last results."""
        self._library.gc_loop_read(self._at, self._result)
        return LoopResult.of(self._result)


def _floats(values: Sequence[float]) -> ctypes.Array:
    return (ctypes.c_float * len(values))(*values)
