"""Targets: arcs, what is refused and with which words."""

import numpy as np
import pytest

from gravcomp.inverse import Target, TargetError, bend_target


def test_arc_has_its_length_and_ends_in_its_direction():
    target = bend_target(0.1, 1.2, 0.7, backbone_station=np.linspace(0, 1, 2001), backbone_weight=np.ones(2001))
    steps = np.diff(target.backbone_position, axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(0.1, rel=1e-6)
    assert steps[-1] / np.linalg.norm(steps[-1]) == pytest.approx(target.tip_direction, abs=1e-3)
    assert target.backbone_position[-1] == pytest.approx(target.tip_position)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"tip_position": [0, 0]}, "tip_position has the shape (2,)"),
        ({"tip_position": [0, 0, np.nan]}, "finite"),
        ({"tip_position": [0, 0, 1], "tip_direction": [0, 0, 0]}, "length 0"),
        ({"tip_position": [0, 0, 1], "tip_position_weight": -1.0}, "from 0 to 1000 are needed"),
        ({"tip_position": [0, 0, 1], "tip_position_weight": 1e300}, "from 0 to 1000 are needed"),
        ({"tip_position": [0, 0, 1], "tip_position_weight": 0.0}, "every weight is 0"),
        ({"tip_position": [0, 0, 1], "tip_direction_weight": 1.0}, "without a tip_direction"),
        (
            {"tip_position": [0, 0, 1], "backbone_station": [1.5], "backbone_position": [[0, 0, 1]], "backbone_weight": [1]},
            "0 (base) to 1 (tip)",
        ),
        (
            {"tip_position": [0, 0, 1], "backbone_station": [0.5], "backbone_position": [[0, 0, 1]], "backbone_weight": []},
            "backbone_weight",
        ),
    ],
)
def test_unusable_target_is_refused_with_a_reason(arguments, said):
    with pytest.raises(TargetError, match=said.replace("(", r"\(").replace(")", r"\)")):
        Target(**arguments)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"tip_position": [0, 0, 100.0]}, "tip_position is 100 m from the base"),  # millimetres
        (
            {"tip_position": [0, 0, 0.1], "backbone_station": [0.5], "backbone_position": [[0, 1, 0]], "backbone_weight": [1]},
            "backbone_position 0 is 1 m",
        ),
    ],
)
def test_points_far_out_of_reach_are_refused(arguments, said):
    with pytest.raises(TargetError, match=f"{said}.*up to 0.15 m"):
        Target(**arguments).check_reach(0.1)


def test_points_without_weight_or_slightly_out_of_reach_are_allowed():
    Target([0, 0, 9.0], tip_position_weight=0.0, tip_direction=[0, 0, 1], tip_direction_weight=1.0).check_reach(0.1)
    Target([0, 0, 0.12]).check_reach(0.1)


def test_a_target_with_its_tip_elsewhere_is_otherwise_the_same():
    target = bend_target(0.1, 1.2, 0.7, tip_direction_weight=1e-3, backbone_station=[0.5], backbone_weight=[1.0])
    moved = target.with_tip_at(np.array([0.01, 0.02, 0.03]))
    assert moved.tip_position.tolist() == [0.01, 0.02, 0.03] and target.tip_position.tolist() != [0.01, 0.02, 0.03]
    for name in ("tip_direction", "backbone_station", "backbone_position", "backbone_weight"):
        assert getattr(moved, name) is getattr(target, name)
    with pytest.raises(TargetError, match="finite"):
        target.with_tip_at(np.array([0.0, np.inf, 0.1]))
