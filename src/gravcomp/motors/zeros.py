"""Zero positions of the rotors: unknown at first, set by the bridge or by homing."""

from collections.abc import Sequence


class ZeroPositions:
    """Zero position (counts) of every rotor, None where it is unknown.

    Homing works with provisional zero positions; the earlier ones come back when it does not succeed.
    """

    def __init__(self, number: int):
        self._zeros: list[int | None] = [None] * number
        self._before_homing: list[int | None] | None = None

    def __getitem__(self, index: int) -> int | None:
        return self._zeros[index]

    def __setitem__(self, index: int, zero: int | None) -> None:
        self._zeros[index] = zero

    @property
    def known(self) -> bool:
        """Whether every zero position is known."""
        return None not in self._zeros

    @property
    def lasting(self) -> list[int | None]:
        """Zero positions without provisional ones: during homing, those from before it."""
        return list(self._zeros if self._before_homing is None else self._before_homing)

    def fill(self, counts: Sequence[int | None]) -> None:
        """Set every unknown zero position to the rotor's present count."""
        self._zeros = [count if zero is None else zero for zero, count in zip(self._zeros, counts)]

    def begin_homing(self, counts: Sequence[int | None]) -> None:
        """Keep the zero positions and use the present counts as provisional ones."""
        self._before_homing = self._zeros
        self._zeros = list(counts)

    def finish_homing(self, shifts: Sequence[int]) -> None:
        """Shift the provisional zero positions by these counts; they are lasting from now on."""
        self._zeros = [None if zero is None else zero + shift for zero, shift in zip(self._zeros, shifts)]
        self._before_homing = None

    def abandon_homing(self) -> None:
        """Return to the zero positions from before homing; no effect when no homing is under way."""
        if self._before_homing is not None:
            self._zeros, self._before_homing = self._before_homing, None
