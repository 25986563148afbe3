"""Sliding tendons: routes, lengths, forces, and which cables are taut."""

from gravcomp.compiled_functions import configure_numba

configure_numba()
