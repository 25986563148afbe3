"""Mechanics of the soft body: elements, materials, mass, and the stiffness matrix with its factorisation."""

from gravcomp.cache import configure_numba

configure_numba()
