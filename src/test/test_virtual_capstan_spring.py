"""What a capstan of the virtual robot feels within a step: line and path of the tendon in series."""

import numpy as np
import pytest

from gravcomp.virtual.capstan_spring import capstan_springs


def test_a_taut_cable_is_line_and_path_in_series_and_others_begin_at_their_length():
    tension, stiffness = np.array([2.0, 0.0, 0.0]), np.array([1000.0, 1000.0, 0.0])  # taut, slack, broken
    wound, shortened = np.array([8e-3, 1e-3, 2e-3]), np.array([5e-3, 3e-3, 4e-3])
    contact, spring = capstan_springs(tension, stiffness, np.full(3, 1e-3), wound, shortened)
    assert spring == pytest.approx([500.0, 500.0, 0.0])
    # 2 N at 8 mm of a spring of 500 N/m: slack 4 mm before.
    assert contact == pytest.approx([4e-3, 3e-3, 4e-3])
