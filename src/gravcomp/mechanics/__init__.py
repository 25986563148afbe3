"""Mechanics of the soft body: elements, mass, and the stiffness matrix with its factorisation."""

from gravcomp.compiled_functions import configure_numba

configure_numba()
