"""Entropy of counts, its correction for small samples, and the distance between two distributions."""

import numpy as np


def entropy(counts: np.ndarray) -> np.ndarray:
    """Plug-in entropy of counts `(..., K)`, bits; 0 where there are none."""
    counts = np.asarray(counts, dtype=float)
    total = counts.sum(axis=-1, keepdims=True)
    shares = np.divide(counts, total, out=np.zeros_like(counts), where=total > 0)
    logs = np.log2(shares, out=np.zeros_like(shares), where=shares > 0)
    return np.maximum(0.0, -(shares * logs).sum(axis=-1))


def miller_madow(counts: np.ndarray) -> np.ndarray:
    """Entropy of counts `(..., K)` plus Miller's correction (K_seen - 1) / (2 n ln 2), bits (Miller 1955)."""
    counts = np.asarray(counts, dtype=float)
    total = np.maximum(counts.sum(axis=-1), 1.0)
    seen = np.maximum((counts > 0).sum(axis=-1), 1)
    return entropy(counts) + (seen - 1) / (2 * total * np.log(2))


def simpson(counts: np.ndarray) -> np.ndarray:
    """Chance that two different draws differ, 1 - sum n (n - 1) / (N (N - 1)) of counts `(..., K)` (Simpson 1949)."""
    counts = np.asarray(counts, dtype=float)
    total = counts.sum(axis=-1)
    return 1 - (counts * (counts - 1)).sum(axis=-1) / np.maximum(total * (total - 1), 1.0)


def jensen_shannon(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Jensen-Shannon divergence between two distributions, given as counts `(..., K)`; 0 to 1 bit (Lin 1991)."""
    p, q = (np.asarray(counts, dtype=float) for counts in (one, other))
    p = p / p.sum(axis=-1, keepdims=True)
    q = q / q.sum(axis=-1, keepdims=True)
    return np.maximum(0.0, entropy((p + q) / 2) - (entropy(p) + entropy(q)) / 2)
