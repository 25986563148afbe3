"""Errors of bodies that cannot be meshed."""


class MeshError(ValueError):
    """A body that cannot be meshed, or an unusable mesh; the text says what was found and what is allowed."""
