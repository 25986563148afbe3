"""Images of samples: of a robot that turns or mirrors map onto itself, every equilibrium is known several times."""

import numpy as np

from gravcomp.full_model.symmetry import Symmetry
from gravcomp.training.samples import Sample


def with_images(samples: list[Sample], symmetries: list[Symmetry]) -> list[Sample]:
    """Return the samples, each followed by its images under the symmetries."""
    return [shown for sample in samples for shown in (sample, *(_image(sample, symmetry) for symmetry in symmetries))]


def _image(sample: Sample, symmetry: Symmetry) -> Sample:
    matrix, load = symmetry.matrix, sample.load
    handed = np.linalg.det(matrix)  # a mirror turns a moment the other way round
    return Sample(
        unknowns=symmetry.of_unknowns(sample.unknowns),
        gravity=matrix @ sample.gravity,
        tension=symmetry.of_cables(sample.tension),
        pulling=symmetry.of_cables(sample.pulling),
        load=np.concatenate([matrix @ load[:3], handed * (matrix @ load[3:6]), load[6:]]),
    )
