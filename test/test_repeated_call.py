"""Calls of a service that are repeated until it answers that it has succeeded."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="a part of the nodes: ./gravcomp test")

from gravcomp_node.repeated_call import RepeatedCall
from rclpy.task import Future
from std_srvs.srv import Trigger

from gravcomp_node import repeated_call


class Service:
    """A client of a service that answers when the test says so, and its clock."""

    srv_name = "node/act"

    def __init__(self, monkeypatch):
        self.ready, self.time, self.calls, self.given_up = True, 0.0, [], []
        monkeypatch.setattr(repeated_call, "time", SimpleNamespace(monotonic=lambda: self.time))

    def service_is_ready(self):
        return self.ready

    def call_async(self, request):
        self.calls.append(Future())
        return self.calls[-1]

    def remove_pending_request(self, future):
        self.given_up.append(future)

    def answer(self, success, message=""):
        self.calls[-1].set_result(Trigger.Response(success=success, message=message))


@pytest.fixture
def service(monkeypatch):
    return Service(monkeypatch)


def test_it_calls_once_and_succeeds_with_the_answer(service):
    call = RepeatedCall(service, Trigger.Request())
    assert not call.succeeds() and not call.succeeds()
    service.answer(True)
    service.time = 100.0
    assert call.succeeds() and call.succeeds()
    assert len(service.calls) == 1


def test_it_waits_for_the_service(service):
    service.ready = False
    call = RepeatedCall(service, Trigger.Request())
    assert not call.succeeds() and not service.calls
    service.ready = True
    assert not call.succeeds() and len(service.calls) == 1


def test_a_refused_call_is_repeated_after_a_pause(service):
    call = RepeatedCall(service, Trigger.Request())
    call.succeeds()
    service.answer(False, "not active")
    assert not call.succeeds() and call.refusal == "not active" and len(service.calls) == 1
    service.time = 1.1
    assert not call.succeeds() and len(service.calls) == 2
    service.answer(True)
    assert call.succeeds() and call.refusal == ""


def test_a_lost_call_is_given_up_and_repeated(service):
    call = RepeatedCall(service, Trigger.Request())
    call.succeeds()
    service.time = 5.1
    assert not call.succeeds()
    assert service.given_up == service.calls[:1] and len(service.calls) == 2
