"""A shape of a model, of which tests of messages need nothing but numbers."""

import numpy as np
import pytest

from gravcomp.simulation import Response, Shape, ShapeStatus


@pytest.fixture
def shape() -> Shape:
    """A shape of random numbers, without contact."""
    random = np.random.default_rng(1)
    points, cables = 5, 6
    return Shape(
        tip_position=random.normal(size=3),
        tip_orientation=np.array([0.0, 0.6, 0.0, 0.8]),
        backbone_station=np.linspace(0, 1, points),
        backbone_position=random.normal(size=(points, 3)),
        backbone_orientation=np.tile([0.0, 0.0, 0.0, 1.0], (points, 1)),
        cable_displacement=random.normal(size=cables),
        cable_tension=random.uniform(size=cables),
        gravity=random.normal(size=3),
        response=Response(
            random.normal(size=(cables, cables)) + 5.0 * np.eye(cables),
            random.normal(size=(6 + 3 * points, cables)),
            random.normal(size=cables),
            random.normal(size=6 + 3 * points),
        ),
        residual=1e-9,
        error_estimate=2e-5,
        solve_time=1e-3,
        model="reduced",
        status=ShapeStatus.FALLBACK,
        message="beyond its range",
    )
