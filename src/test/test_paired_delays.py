"""The ratio of paired delays is found under a load that changes, and is refused where the load moves it."""

import can
import numpy as np
import pytest

from gravcomp.bench import composition
from gravcomp.description.hardware import CanInterface
from gravcomp.evaluation import bus_delay


def test_the_median_of_the_pairs_is_known_to_its_spread():
    load = np.array([1.0, 3.0, 1.2, 2.0, 9.0, 1.1])  # of the machine, alike within a pair
    found = composition.ratio(3.0 * load, 2.0 * load * np.array([1.0, 1.01, 0.99, 1.02, 1.0, 0.98]))
    assert found.less == pytest.approx(100.0 / 3.0, abs=0.5) and found.within < 1.0 and found.is_known
    one_is_swamped = composition.ratio([3.0, 3.0, 3.0, 3.0, 3.0, 3.0], [2.0, 2.1, 1.9, 2.0, 2.0, 16.0])
    assert one_is_swamped.less == pytest.approx(33.3, abs=0.1) and one_is_swamped.is_known


def test_a_single_pair_is_not_known():
    assert not composition.ratio([3.0], [2.0]).is_known


def test_a_large_ratio_may_be_known_less_narrowly():
    assert composition.Ratio(50.0, 8.0).is_known
    assert not composition.Ratio(25.0, 8.0).is_known


def _measured(monkeypatch, delays: dict[bool, list[list[float]]], pairs: int) -> dict:
    runs = {kind: iter(of_kind) for kind, of_kind in delays.items()}
    monkeypatch.setattr(composition, "_delays", lambda composed, listen, warm_up: next(runs[composed]))
    return composition.compare(lambda _: None, pairs=pairs, listen=1.0, warm_up=0.0)


def test_pairs_are_added_until_the_ratio_is_known(monkeypatch):
    apart = [[3.0] * 100] * 10
    together = [[x] * 100 for x in (2.0, 1.5, 2.6, 1.4, 2.6, 1.4, 2.0, 2.0, 2.0, 2.0)]
    together[1] = []  # a run in which nothing was heard
    result = _measured(monkeypatch, {False: apart, True: together}, 10)
    assert result["composed"]["less_pct"]["median"] == pytest.approx(33.3, abs=0.1)
    assert 5 < result["composed"]["pairs"] < 10 and result["composed"]["commands_hz"] == 100.0
    assert result["composed"]["less_pct"]["within"] <= 0.2 * 33.3


def test_no_answer_where_the_load_moves_the_delay_more_than_the_nodes(monkeypatch):
    together = [[x] * 100 for x in (1.0, 9.0, 2.0, 12.0, 1.5, 5.0)]
    with pytest.raises(TimeoutError, match="other programs move the delay"):
        _measured(monkeypatch, {False: [[3.0] * 100] * 6, True: together}, 6)


def test_nothing_heard_is_an_error(monkeypatch):
    with pytest.raises(TimeoutError, match="no command was traced"):
        _measured(monkeypatch, {False: [[]], True: [[]]}, 1)


def test_the_bus_is_closed_when_listening_to_it_fails(monkeypatch):
    closed = []

    def lost(*_):
        raise can.CanError("unplugged")

    monkeypatch.setattr(bus_delay.CanLink, "open", lambda _: None)
    monkeypatch.setattr(bus_delay.CanLink, "receive", lost)
    monkeypatch.setattr(bus_delay.CanLink, "close", lambda _: closed.append(True))
    with pytest.raises(can.CanError, match="unplugged"):
        bus_delay.delays_during(CanInterface(), 1.0)
    assert closed
