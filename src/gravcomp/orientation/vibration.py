"""How noisy the samples of a sensor are while it vibrates, from the samples themselves.

A vibration near or beyond half the sample rate is aliased: in a sum of the samples it is noise, which no data sheet names. A
motion is smooth, so its fourth difference x - 4 x' + 6 x'' - 4 x''' + x'''' is nearly zero; that of white noise with the variance
s^2 on each axis has the variance 70 s^2. So the samples have the noise density s^2 dt.

The vibration of a machine is no white noise: its tones have more at their frequencies than at the low ones that a sum adds up. So
the density is also that of means of two and of four samples, and the least of the three counts: means have less of a tone, and
more of a motion.
"""

from gravcomp.orientation.quaternion import Vector

MEMORY = 1.0  # s
_ORDER = 4
_SQUARES = 70.0  # sum of the squares of the weights 1, 4, 6, 4, 1


class Vibration:
    """Noise of one sensor of three axes, in the square of its unit: (m/s^2)^2 or (rad/s)^2."""

    def __init__(self, means: int) -> None:
        """means: kinds of means, of one sample, of two, of four, ..."""
        # For each kind: a mean that waits for its neighbour, the last four means, and the density.
        self._kinds: list[tuple[Vector | None, tuple[Vector, ...], float]] = [(None, (), 0.0)] * means

    def reset(self) -> None:
        """Forget everything."""
        self._kinds = [(None, (), 0.0)] * len(self._kinds)

    def interrupt(self) -> None:
        """Forget the samples, not the noise: what follows is no continuation of them."""
        self._kinds = [(None, (), density) for _, _, density in self._kinds]

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        return tuple(self._kinds)

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self._kinds = list(state)

    def take(self, dt: float, value: Vector) -> None:
        """Take a sample (3,), `dt` s after the last one."""
        mean = value
        for k, (waiting, last, density) in enumerate(self._kinds):
            if len(last) == _ORDER:
                (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = last
                x, y, z = mean
                x += ax - 4.0 * (bx + dx) + 6.0 * cx
                y += ay - 4.0 * (by + dy) + 6.0 * cy
                z += az - 4.0 * (bz + dz) + 6.0 * cz
                density += dt / (MEMORY + dt) * ((x * x + y * y + z * z) * dt / (3.0 * _SQUARES) - density)
                last = last[1:]
            if waiting is None:
                self._kinds[k] = (mean, (*last, mean), density)
                return
            self._kinds[k] = (None, (*last, mean), density)
            (x, y, z), (ax, ay, az) = mean, waiting
            mean = 0.5 * (x + ax), 0.5 * (y + ay), 0.5 * (z + az)
            dt *= 2.0

    @property
    def density(self) -> float:
        """Spectral density of the noise that a sum of the samples has on each axis, in the square of the unit per Hz."""
        return min(density for _, _, density in self._kinds)

    def variance(self, period: float) -> float:
        """Return the variance of a single sample on each axis, with the period in s between two of them."""
        return self._kinds[0][2] / period if period > 0.0 else 0.0
