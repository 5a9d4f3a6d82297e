"""Connected components of a graph."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray


def components(n: int, pairs: ndarray | Sequence[ndarray]) -> ndarray:
    """Number of the connected component of each of n items, shape (n,).

    ``pairs`` are the joined items, shape (2, n_pairs).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = pairs
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])
