"""The rotation nearest to a matrix (polar decomposition), never a reflection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrices = NDArray[np.floating]  # (..., 3, 3)

# Blends of rotations that lie close together have determinants near one. Six steps reach rounding
# (1e-15) from 0.1 on; below it the singular values say what is nearest.
_STEPS = 6
_LEAST_DETERMINANT = 0.1


def nearest_rotation(matrices: Matrices) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) nearest in the Frobenius norm to matrices near rotations.

    Newton's iteration ``X <- (g X + (g X)^-T) / 2`` with ``g`` scaling to determinant one (Higham
    1986), a quarter of the cost of the singular values; those serve where it converges slowly.
    """
    flat = matrices.reshape(-1, 3, 3).astype(np.float64)
    determinant = np.linalg.det(flat)
    easy = determinant > _LEAST_DETERMINANT
    result = np.empty_like(flat)
    result[easy] = _newton(flat[easy])
    result[~easy] = rotation_by_svd(flat[~easy])
    return result.reshape(matrices.shape)


def rotation_by_svd(matrices: Matrices) -> NDArray[np.float64]:
    """The same for any matrices (..., 3, 3), by their singular values (Kabsch)."""
    u, _, vt = np.linalg.svd(matrices.astype(np.float64))
    handed = np.ones(u.shape[:-1])
    handed[..., -1] = np.sign(np.linalg.det(u @ vt))
    return (u * handed[..., None, :]) @ vt


def _newton(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthogonal factors of matrices (N, 3, 3) with positive determinants."""
    for _ in range(_STEPS):
        first, second, third = np.moveaxis(matrices, -2, 0)
        cofactors = np.stack(
            [np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=-2
        )
        determinant = (first * cofactors[:, 0]).sum(-1)[:, None, None]
        scale = determinant ** (-1.0 / 3.0)
        matrices = 0.5 * (scale * matrices + cofactors / (scale * determinant))
    return matrices
