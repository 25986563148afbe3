"""Mechanics of the soft body: elements, mass, and the stiffness matrix with its factorisation."""
