"""The algebra of a covariance that is blocks plus independent effects: solve, weigh, whiten.

The blocks are factored once for a grid point. Effects that reach across them (sensor gains, an error of the lens, a
random function) are columns, and cost a small matrix of their own (Woodbury 1950, Memorandum Report 42, Princeton).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.blas import dtrsm

from analysis.cases.model import Floats


class Blocks:
    """Cholesky factors of the covariances of groups of readings; ``rows`` says which readings a group holds.

    They are solved by BLAS itself, transposed, as it has columns where numpy has rows: some are small, and asked often.
    """

    def __init__(self, rows: Sequence[NDArray[np.int64]], factors: Sequence[Floats]) -> None:
        self._rows = rows
        self._factors = factors
        self.log_det = sum(2.0 * float(np.sum(np.log(np.diag(f)))) for f in factors)

    def solved(self, columns: Floats) -> Floats:
        """Columns (N, k) divided by the factors: block noise becomes independent and unit."""
        white = np.empty_like(columns)
        for rows, factor in zip(self._rows, self._factors, strict=True):
            white[rows] = dtrsm(1.0, factor.T, columns[rows].T, side=1).T
        return white

    def solved_back(self, white: Floats) -> Floats:
        """Columns (N, k) divided by the factors' transposes."""
        made = np.empty_like(white)
        for rows, factor in zip(self._rows, self._factors, strict=True):
            made[rows] = dtrsm(1.0, factor.T, white[rows].T, side=1, trans_a=1).T
        return made


class Solved:
    """Independent effects (N, K), already solved by the block factors, with the products that covariances need."""

    def __init__(self, columns: Floats) -> None:
        self.columns = columns
        self._products: dict[int, tuple[Solved, Floats]] = {}  # with the other, so that its id stays its own

    def times(self, other: "Solved") -> Floats:
        """``columnsᵀ other.columns``, made once; shape (K, L)."""
        if id(other) not in self._products:
            self._products[id(other)] = (other, self.columns.T @ other.columns)
        return self._products[id(other)][1]


Scaled = tuple[Solved, float]
"""Effects and how large they are."""


@dataclass(frozen=True)
class Factored:
    """Block factors and the nuisance effects solved by them, for all errors of the lens."""

    blocks: Blocks
    gains: Solved
    lens_error: Solved

    def whitener(self, lens: float, extra: tuple[Scaled, ...] = ()) -> "Whitener":
        """The covariance with ``lens`` times the usual error of the lens, and with extra effects."""
        return Whitener(self.blocks, ((self.gains, 1.0), (self.lens_error, lens), *extra))


class Whitener:
    """A factored covariance: block factors, and independent effects given as columns (sensor gains, random functions).

    Parameters
    ----------
    parts
        Columns u with covariance sum u uᵀ, already solved by the block factors, and their sizes.
    """

    def __init__(self, blocks: Blocks, parts: tuple[Scaled, ...]) -> None:
        self.blocks = blocks
        self._parts = parts
        edge = np.cumsum([0, *(part.columns.shape[1] for part, _ in parts)])
        inner = np.eye(edge[-1])
        for k, (part, size) in enumerate(parts):
            for m, (other, its_size) in enumerate(parts[: k + 1]):  # the later one, forgotten first, keeps the product
                inner[edge[k] : edge[k + 1], edge[m] : edge[m + 1]] += size * its_size * part.times(other)
        self._inner = cho_factor(inner, lower=True)
        self.log_det = blocks.log_det + 2.0 * float(np.sum(np.log(np.diag(self._inner[0]))))

    @property
    def _effects(self) -> Floats:
        """All effects in a row; shape (N, K)."""
        return np.concatenate([size * part.columns for part, size in self._parts], axis=1)

    def _onto(self, white: Floats) -> Floats:
        """Effects' products with columns (N, k) that are already solved; shape (K, k)."""
        return np.concatenate([size * (part.columns.T @ white) for part, size in self._parts])

    def solved(self, columns: Floats) -> Floats:
        """Columns (N, k) divided by the block factors; effects not yet taken off."""
        return self.blocks.solved(columns)

    def gram_of(self, white: Solved) -> Floats:
        """`gram` of columns that are already solved, by block factors that other effects' sizes may share."""
        onto = np.concatenate([size * white.times(part).T for part, size in self._parts])
        return np.asarray(white.columns.T @ white.columns - onto.T @ cho_solve(self._inner, onto))

    def gram(self, columns: Floats) -> Floats:
        """``columns``ᵀ Σ⁻¹ ``columns`` for columns (N, k); shape (k, k)."""
        return self.gram_of(Solved(self.solved(columns)))

    def squares(self, columns: Floats) -> Floats:
        """cᵀ Σ⁻¹ c of each column c of (N, k); shape (k,)."""
        white = self.solved(columns)
        onto = self._onto(white)
        return np.asarray(np.sum(white**2, axis=0) - np.sum(onto * cho_solve(self._inner, onto), axis=0))

    def whitened(self, columns: Floats) -> Floats:
        """Columns (N, k) turned so that pure nuisance becomes independent unit noise (effects included).

        (1 + E Eᵀ)^(-1/2) by the eigenvectors of Eᵀ E: few, and found where a singular value decomposition may not
        converge.
        """
        white, effects = self.solved(columns), self._effects
        square, vectors = np.linalg.eigh(effects.T @ effects)
        size = np.sqrt(1.0 + np.maximum(square, 0.0))
        shrink = 1.0 / (size * (1.0 + size))  # (1 - 1 / size) / (size² - 1), without its 0 / 0
        turned = vectors.T @ (effects.T @ white)
        return np.asarray(white - effects @ (vectors @ (shrink[:, None] * turned)))

    def weights(self, residual: Floats) -> Floats:
        """Σ⁻¹ ``residual``; shape (N,)."""
        white = self.solved(residual[:, None])
        left = white - self._effects @ cho_solve(self._inner, self._onto(white))
        return np.asarray(self.blocks.solved_back(left)[:, 0])

    def effects_mean(self, residual: Floats) -> Floats:
        """Expected size (K,) of each effect given a residual (N,), in units of its own standard deviation."""
        return np.asarray(cho_solve(self._inner, self._onto(self.solved(residual[:, None]))[:, 0]))
