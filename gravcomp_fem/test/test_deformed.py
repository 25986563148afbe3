"""The controller takes the same from a shape of its process as from the shape's message."""

import dataclasses

import numpy as np
import pytest
from gravcomp_fem.deformed import PublishedShape, from_message, from_shape
from std_msgs.msg import Header

from gravcomp.contact.contacts import Contacts
from gravcomp.simulation import ShapeStatus


@pytest.fixture
def published(shape) -> PublishedShape:
    rng, cables = np.random.default_rng(3), len(shape.cable_tension)
    contacts = Contacts(
        obstacle=np.array([0, 1]), station=np.array([0.3, 0.9]), position=rng.normal(size=(2, 3)), normal=np.eye(3)[:2],
        force=rng.normal(size=(2, 3)), gap=np.zeros(2), sliding=np.zeros(2, bool), by_tension=rng.normal(size=(2, cables)),
        names=("table", "ball"),
    )  # fmt: skip
    return PublishedShape(dataclasses.replace(shape, contacts=contacts), Header(frame_id="soft_base"), np.array([0.1, 0.2, 0.3]))


def test_a_shape_and_its_message_say_the_same(published):
    here, there = from_shape(published), from_message(published.message())
    for field in dataclasses.fields(here):
        mine, other = getattr(here, field.name), getattr(there, field.name)
        if dataclasses.is_dataclass(mine):
            for part in dataclasses.fields(mine):
                assert np.array_equal(getattr(mine, part.name), getattr(other, part.name)), part.name
        else:
            assert np.array_equal(mine, other), field.name
    assert here.status == ShapeStatus.FALLBACK and len(here.contact) == 2


def test_gravity_and_what_a_turning_base_adds_are_apart(published):
    message = published.message()
    gravity, turn = ([v.x, v.y, v.z] for v in (message.gravity, message.turn_acceleration))
    assert turn == published.turn.tolist() and np.add(gravity, turn) == pytest.approx(published.shape.gravity)


@pytest.mark.parametrize(
    ("of_response", "name", "change", "said"),
    [
        (True, "compliance_ea", lambda x: np.where(x > 0.0, np.nan, 0.0), "compliance_ea has numbers that are not finite"),
        (True, "compliance_aa", lambda x: -x, "the diagonal of compliance_aa"),
        (False, "cable_tension", lambda x: x + np.inf, "cable_tension has numbers that are not finite"),
        (False, "gravity", lambda x: x * np.nan, "gravity has numbers that are not finite"),
    ],
)
def test_the_same_numbers_are_refused_in_both_ways(published, of_response, name, change, said):
    shape = published.shape
    if of_response:
        broken = dataclasses.replace(shape.response, **{name: change(getattr(shape.response, name))})
        shape = dataclasses.replace(shape, response=broken)
    else:
        shape = dataclasses.replace(shape, **{name: change(getattr(shape, name))})
    published = PublishedShape(shape, published.header, published.turn)
    for read, given in ((from_shape, published), (from_message, published.message())):
        with pytest.raises(ValueError, match=said):
            read(given)
