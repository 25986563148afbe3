"""How deep a robot is in obstacles, at points all over its surface: it checks the places that the model of contact finds."""

import numpy as np

from gravcomp.contact.own_surface import OwnSurface
from gravcomp.full_model.contact import FullContact
from gravcomp.full_model.model import MeshedModel
from gravcomp.mesh.sections import section_functionals

_IN_RADIUS, _NEAR = 5, 0.5  # sections in a radius of the robot; parts of it: sections nearer than that are looked at
_AROUND = 180  # points of an outline: between them a round one is deeper by 0.02 % of its radius


def sampled_depth(contact: FullContact, u: np.ndarray) -> float:
    """Return in m how deep the surface is in an obstacle at the displacements u (n, 3), 0 outside.

    Round outlines are looked at in the stations and in the middle between them, where these are a cubic through four of them;
    others in the stations only. The tip's face is not looked at within its rim.
    """
    stations, surface = contact.sections(u), contact.surface
    between = (9.0 * (stations[1:-2] + stations[2:-1]) - stations[:-3] - stations[3:]) / 16.0
    sections = np.concatenate([stations, between])
    radius = np.concatenate([surface.radius, 0.5 * (surface.radius[1:-2] + surface.radius[2:-1])])
    gap = contact.scene.nearest(sections[:, 0], contact.arrays)[0]
    near = np.flatnonzero(gap < radius)
    if surface.outline.shape[1]:
        near = near[near < len(stations)]
        own = surface.outline[near]
    else:
        angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        own = radius[near, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    points = sections[near, None, 0] + own @ sections[near, 1:]
    return max(0.0, -float(contact.scene.nearest(points, contact.arrays)[0].min(initial=0.0)))


def sampled_own_depth(model: MeshedModel, u: np.ndarray, surface: OwnSurface) -> float:
    """Return in m how deep the robot is in itself at the displacements u (n, 3), 0 outside; negative: the smallest distance.

    Points around round sections, five in a radius of the robot, are compared with balls around the middles of those nearer to the
    base; sections that `contact.own_pairs` counts as neighbours are left out. surface gives the radii.
    """
    count = int(np.ceil(_IN_RADIUS * model.length / surface.radius.min()))
    place = model.length * np.arange(1, count + 1) / count
    sections = (section_functionals(model.mesh, place) @ (model.mesh.nodes + u)).reshape(-1, 3, 3)
    radius, angle = np.interp(place, surface.place, surface.radius), 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    strained = 0.5 * radius * np.linalg.norm(sections[:, 1:], axis=2).sum(axis=1)
    around, smallest = np.column_stack([np.cos(angle), np.sin(angle)]), np.inf
    for i in range(count):
        apart = np.flatnonzero(place[i] - place > 0.5 * np.pi * (radius[i] + radius))
        between = np.linalg.norm(sections[apart, 0] - sections[i, 0], axis=1) - strained[i] - strained[apart]
        far = between >= _NEAR * radius[i]
        smallest, near = min(smallest, float(between[far].min(initial=np.inf))), apart[~far]
        if len(near):
            points = sections[i, 0] + radius[i] * around @ sections[i, 1:]
            distance = np.linalg.norm(points[:, None] - sections[near, 0], axis=2) - strained[near]
            smallest = min(smallest, float(distance.min()))
    return -smallest
