"""Whether a machine kept up with the loop during a run: what is measured on an overloaded one says little of the robot."""

from gravcomp.virtual.imu_chip import SAMPLE_PERIOD

_LEAST_RATE = 0.9  # of the rate of the samples: a loop that keeps up answers every sample


def overload(imu_rate: float | None, command_rate: float | None, delay: float | None) -> str | None:
    """Return why the figures of a run are those of an overloaded machine, as a sentence; None where it kept up.

    imu_rate, command_rate: samples and commands per second; delay: median from a sample to the current that it caused, in s.
    None: not measured.
    """
    nominal, found = 1.0 / SAMPLE_PERIOD, []
    for what, rate in (("IMU samples", imu_rate), ("commands", command_rate)):
        if rate is not None and rate < _LEAST_RATE * nominal:
            found.append(f"{what} came at {rate:.0f} Hz in place of {nominal:.0f}")
    if delay is not None and delay > SAMPLE_PERIOD:
        found.append(
            f"half of the commands came later than {1e3 * delay:.0f} ms, and samples come every {1e3 * SAMPLE_PERIOD:.0f} ms"
        )
    if not found:
        return None
    return (
        f"This machine did not keep up with the loop: {'; '.join(found)}. All figures of this run, also the errors, the time to"
        " settle and the correlation, are those of an overloaded machine; end other programmes and run it again"
    )
