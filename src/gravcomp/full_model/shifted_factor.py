"""Factor of a tangent that is not positive definite: with the smallest multiple of the identity that makes it so."""

from gravcomp.mechanics.block_matrix import BlockCholesky, BlockMatrix, NotPositiveDefinite

# Powers of ten of the shift over the unit.
_LEAST, _MOST = -6, 0


class ShiftedFactor:
    """Adds shifts to the tangents of one matrix; remembers the last one, from which the next search begins.

    matrix: whose values are the tangent at each call; unit: N/m, its mean diagonal.
    """

    def __init__(self, matrix: BlockMatrix, unit: float):
        self._matrix, self._unit = matrix, unit
        self._power = _LEAST

    def factor(self) -> BlockCholesky:
        """Return the factor with the smallest shift that helps. Raises NotPositiveDefinite if none does.

        Tangents of neighbouring iterates need about the same shift, and what is definite with one is so with every larger one:
        mostly two factorisations find it, that of the next smaller shift fails.
        """
        tangent = self._matrix.values.copy()

        def shifted(power: int) -> BlockCholesky | None:
            self._matrix.values[:] = tangent
            self._matrix.add_diagonal(self._unit * 10.0**power)
            try:
                return self._matrix.factor()
            except NotPositiveDefinite:
                return None

        power = max(self._power - 1, _LEAST)
        found = shifted(power)
        while found is not None and power > _LEAST:
            power -= 1
            found = shifted(power)
        while found is None and power < _MOST:
            power += 1
            found = shifted(power)
        self._power = power
        if found is None:
            raise NotPositiveDefinite("the tangent stiffness is not positive definite, with any shift of its diagonal")
        return found
