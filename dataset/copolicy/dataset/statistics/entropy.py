"""Entropy of counts, with a correction for small samples, Simpson's index and the Jensen-Shannon divergence."""

import numpy as np

from ..arrays import Array


def entropy(counts: Array) -> Array:
    """Plug-in entropy of counts `(..., K)`, bits; 0 if all counts are 0."""
    counts = np.asarray(counts, dtype=float)
    total = counts.sum(axis=-1, keepdims=True)
    proportions = np.divide(counts, total, out=np.zeros_like(counts), where=total > 0)
    logs = np.log2(proportions, out=np.zeros_like(proportions), where=proportions > 0)
    return np.maximum(0.0, -(proportions * logs).sum(axis=-1))


def miller_madow(counts: Array) -> Array:
    """Entropy of counts `(..., K)` plus Miller's correction (K_observed - 1) / (2 n ln 2), bits (Miller 1955)."""
    counts = np.asarray(counts, dtype=float)
    total = np.maximum(counts.sum(axis=-1), 1.0)
    observed = np.maximum((counts > 0).sum(axis=-1), 1)
    return entropy(counts) + (observed - 1) / (2 * total * np.log(2))


def simpson(counts: Array) -> Array:
    """Probability that two draws differ, 1 - sum n (n - 1) / (N (N - 1)), of counts `(..., K)` (Simpson 1949)."""
    counts = np.asarray(counts, dtype=float)
    total = counts.sum(axis=-1)
    return 1 - (counts * (counts - 1)).sum(axis=-1) / np.maximum(total * (total - 1), 1.0)


def jensen_shannon(first: Array, second: Array) -> Array:
    """Jensen-Shannon divergence of two distributions given as counts `(..., K)`, 0 to 1 bit (Lin 1991)."""
    p, q = (np.asarray(counts, dtype=float) for counts in (first, second))
    p = p / p.sum(axis=-1, keepdims=True)
    q = q / q.sum(axis=-1, keepdims=True)
    return np.maximum(0.0, entropy((p + q) / 2) - (entropy(p) + entropy(q)) / 2)
