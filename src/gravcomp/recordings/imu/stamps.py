"""Stamps that cannot be used as they are: all zero, the same for a burst of samples, of a counter that wraps.

Drivers that never fill the header write zeros; drivers that read the sensor's FIFO give all samples of a burst the time of
reading. The samples of a burst were taken at even distances since the last burst, so the last one has the burst's stamp.
"""

import numpy as np

COUNTER_NS = tuple(2**32 * unit for unit in (1, 1_000, 1_000_000))  # ns: range of a counter of 32 bits in ns, us, ms
LONGEST_WRAPPED_STEP = 20  # periods: a longer step is not the next sample of a counter that wrapped
PACE = 0.02  # by which the stamps may advance faster or slower than the times of reception; clocks differ by 0.01 % at most
LONG_ENOUGH = 5 * 10**9  # ns in which a delay of reception does not matter
BURSTS_FROM = 0.1  # of the samples that repeat a stamp with other values: the driver reads in bursts


def wrapped_counter(step_ns: int, period_ns: float) -> int:
    """Return the range in ns of the 32-bit counter that wrapped in a backward step of the stamps, 0 where none explains it."""
    for span in COUNTER_NS:
        if 0 < step_ns + span <= LONGEST_WRAPPED_STEP * period_ns:
            return span
    return 0


def usable_stamps(stamp_ns: np.ndarray, received_ns: np.ndarray | None, values: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return stamps (n,) int64 in ns with which a recording can be used, and a sentence for each repair.

    stamp_ns (n,): as recorded; received_ns (n,): times of reception, None where unknown; values (n, k): the samples.
    """
    notes = []
    stamp_ns = np.asarray(stamp_ns, np.int64)
    unset = stamp_ns == 0
    lost = len(stamp_ns) > 1 and (np.count_nonzero(unset) > 1 or bool((stamp_ns == stamp_ns[0]).all()))
    if lost and received_ns is not None:
        if unset.all() or not unset.any():
            found = "all zero" if unset.all() else "all the same"
            stamp_ns, unset = np.asarray(received_ns, np.int64), np.zeros_like(unset)
            notes.append(f"the stamps are {found}: the times of reception stand in")
        else:
            delay = int(np.median(received_ns[~unset] - stamp_ns[~unset]))
            stamp_ns = np.where(unset, received_ns - delay, stamp_ns)
            count = np.count_nonzero(unset)
            notes.append(f"{count} stamps are zero: the times of reception stand in, less {1e-6 * delay:.1f} ms")
    stamp_ns, wraps = _unwrapped(stamp_ns)
    if wraps:
        notes.append(f"the stamps are those of a 32-bit counter, which wraps {wraps} time(s): continued")
    if received_ns is not None and len(stamp_ns) > 1 and not lost:
        notes += _other_pace(stamp_ns, received_ns)
    spread, longest = _spread_bursts(stamp_ns, values)
    if longest:
        stamp_ns = spread
        notes.append(f"the samples come in bursts of up to {longest} with one stamp: spread evenly since the burst before")
    return stamp_ns, tuple(notes)


def _other_pace(stamp_ns: np.ndarray, received_ns: np.ndarray) -> list[str]:
    """Return a sentence where stamps and times of reception (n,) advance at different paces, as with a wrong sample rate."""
    stamped, received = (int(times.max()) - int(times.min()) for times in (stamp_ns, received_ns))
    if min(stamped, received) < LONG_ENOUGH or abs(stamped / received - 1.0) <= PACE:
        return []
    return [
        f"the stamps advance {stamped / received:.2f} times as fast as the times of reception: the sensor's clock or sample rate"
        " is wrong, or the samples were played at another speed when they were recorded"
    ]


def _unwrapped(stamp_ns: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the stamps (n,) without the wraps of a counter, and their number."""
    step = np.diff(stamp_ns)
    forward = step[step > 0]
    if not len(forward):
        return stamp_ns, 0
    period = float(np.median(forward))
    spans = np.zeros(len(step), np.int64)
    for i in np.flatnonzero(step < 0).tolist():
        spans[i] = wrapped_counter(int(step[i]), period)
    return stamp_ns + np.concatenate([[0], np.cumsum(spans)]), int(np.count_nonzero(spans))


def _spread_bursts(stamp_ns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the stamps (n,) with bursts spread, and the length of the longest burst; 0 where there are no bursts."""
    same = np.diff(stamp_ns) == 0
    other = same & (values[1:] != values[:-1]).any(axis=1)
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    if np.count_nonzero(other) < BURSTS_FROM * len(stamp_ns) or len(starts) < 2:
        return stamp_ns, 0
    count = np.diff(np.append(starts, len(stamp_ns)))
    burst = stamp_ns[starts]
    before = np.concatenate([[2 * burst[0] - burst[1]], burst[:-1]])
    # Where the clock is set back a burst has no time since the one before it; it takes that of a usual burst.
    usual = int(np.median(np.diff(burst)))
    since = np.where((burst > before) & (burst - before < 5 * usual), burst - before, usual)
    place = np.arange(len(stamp_ns)) - np.repeat(starts, count)  # within the burst
    left = np.repeat(count, count) - 1 - place  # samples of the burst that follow
    return np.repeat(burst, count) - np.rint(left * np.repeat(since / count, count)).astype(np.int64), int(count.max())


def nearest(stamp: np.ndarray, truth_stamp: np.ndarray, truth: np.ndarray, tolerance_ns: int = 5_000_000) -> np.ndarray:
    """Return the truth whose stamp is nearest to that of each sample, NaN where they differ by more than the tolerance."""
    after = np.clip(np.searchsorted(truth_stamp, stamp), 1, max(len(truth_stamp) - 1, 1))
    after = np.minimum(after, len(truth_stamp) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(truth_stamp[before] - stamp) <= np.abs(truth_stamp[after] - stamp), before, after)
    result = truth[nearest].copy()
    result[np.abs(truth_stamp[nearest] - stamp) > tolerance_ns] = np.nan
    return result
