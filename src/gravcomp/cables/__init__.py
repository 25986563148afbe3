"""Sliding tendons: where they run, how long they are, what they pull, and when they are slack."""

from gravcomp.compiled_functions import configure_numba

configure_numba()
