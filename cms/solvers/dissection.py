"""Order a sparse symmetric matrix for elimination, by nested dissection of its graph."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from cms.base.arrays import FloatArray, IntArray, SparseMatrix
from cms.component.component import times

LEAF = 100  # rows that are eliminated together without being cut once more
LANDMARKS = 20
SMOOTHINGS = 40
BAND = 0.15  # of a part, to both sides of its middle: where its separators are sought
LONG = 0.6  # axes along which a part is this long, relative to its longest, are tried
FLAT = 1e-12  # of the largest variance: a graph without an extent that way
TINY = 1e-300  # in place of a divisor that is zero
LOW, MIDDLE, HIGH = 0, 1, 2

Mask = NDArray[np.bool_]
Edges = tuple[IntArray, IntArray]


@dataclass(frozen=True, eq=False)
class Front:
    """Rows that are eliminated together.

    Attributes
    ----------
    start, stop : int
        Their places in the order of elimination.
    border : (b,) array
        Later places that their elimination touches, ascending.
    children : tuple of int
        Numbers of the fronts whose borders reach into this one first.
    """

    start: int
    stop: int
    border: IntArray
    children: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.stop - self.start


@dataclass(frozen=True, eq=False)
class Elimination:
    """How a matrix is eliminated.

    Attributes
    ----------
    order : (N,) array
        Row of the matrix at each place.
    fronts : tuple of Front
        Children before their parents.
    """

    order: IntArray
    fronts: tuple[Front, ...]

    @property
    def entries(self) -> int:
        """Numbers that the factor keeps."""
        return sum(f.rows * (f.rows + f.border.size) for f in self.fronts)

    @property
    def most_numbers(self) -> int:
        """Most numbers in memory at one time, with what fronts hand on."""
        kept = handed = most = 0
        for f in self.fronts:
            s, b = f.rows, f.border.size
            panel, update = s * (s + b), b * b
            most = max(most, kept + handed + 2 * panel + update)
            kept += panel
            handed += update - sum(self.fronts[child].border.size ** 2 for child in f.children)
        return most


def dissected(matrix: SparseMatrix) -> Elimination:
    """The order of elimination of a symmetric matrix, by nested dissection.

    Parameters
    ----------
    matrix : (N, N) sparse array
        Symmetric in its pattern, with a full diagonal.

    Returns
    -------
    Elimination

    Notes
    -----
    Rows of one pattern (those of a node) are one vertex of the graph. Its vertices get coordinates
    from their distances to a few landmarks far from each other [1]_; the graph is cut across its
    longest extents, the lightest separator near the middle is taken [3]_, and so on with both
    halves [2]_.

    References
    ----------
    .. [1] de Silva, V. and Tenenbaum, J.B. (2004) Sparse multidimensional scaling using landmark
       points. Technical report, Stanford University.
    .. [2] George, A. (1973) Nested dissection of a regular finite element mesh. SIAM Journal on
       Numerical Analysis 10(2), 345-363.
    .. [3] Ashcraft, C. and Liu, J.W.H. (1998) Applications of the Dulmage-Mendelsohn decomposition
       and network flow to graph bisection improvement. SIAM Journal on Matrix Analysis and
       Applications 19(2), 325-354.
    """
    vertex = vertices(matrix)
    graph = quotient_graph(matrix, vertex)
    weights = np.bincount(vertex)
    groups, children = cut(graph, weights, landmark_coordinates(graph))
    places = np.concatenate(groups)
    by_vertex = np.argsort(vertex, kind="stable")
    starts = np.concatenate([[0], np.cumsum(weights)])
    order = by_vertex[ranges(starts[places], weights[places])]
    return Elimination(order, tuple(fronts_of(graph, weights, groups, children)))


def vertices(matrix: SparseMatrix) -> IntArray:
    """Number of the vertex of every row (N,); rows with one and the same pattern share one."""
    size = matrix.shape[0]
    ones = (np.ones(matrix.nnz), matrix.indices, matrix.indptr)
    marks = np.random.default_rng(0).random((size, 3))
    keys = times(sparse.csc_array(sparse.csr_array(ones, shape=matrix.shape)), marks)
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1]).ravel()


def quotient_graph(matrix: SparseMatrix, vertex: IntArray) -> SparseMatrix:
    """Adjacency of the vertices, without the diagonal."""
    count = int(vertex.max()) + 1
    first = np.unique(vertex, return_index=True)[1]
    lengths = np.diff(matrix.indptr)[first]
    neighbours = vertex[matrix.indices[ranges(matrix.indptr[first], lengths)]]
    owners = np.repeat(np.arange(count), lengths)
    away = neighbours != owners
    graph = sparse.coo_array(
        (np.ones(np.count_nonzero(away)), (owners[away], neighbours[away])), shape=(count, count)
    )
    return sparse.csc_array(graph + graph.T)


def ranges(starts: IntArray, lengths: IntArray) -> IntArray:
    """The numbers from each start on, one range after the other."""
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if ends.size else 0
    return np.asarray(np.arange(total) + np.repeat(starts - (ends - lengths), lengths))


def distances(graph: SparseMatrix, source: int) -> FloatArray:
    """Number of edges from a vertex to every other; infinite where there is no way."""
    order, before = csgraph.breadth_first_order(graph, source, directed=True)
    place = np.zeros(graph.shape[0], dtype=np.intp)
    place[order] = np.arange(order.size)
    came = place[before[order[1:]]]
    found = np.full(graph.shape[0], np.inf)
    found[source] = 0.0
    start, stop, level = 0, 1, 0
    while stop < order.size:
        start, stop = stop, 1 + int(np.searchsorted(came, stop))
        level += 1
        found[order[start:stop]] = level
    return found


def landmark_coordinates(graph: SparseMatrix) -> FloatArray:
    """Coordinates (n, 3) in which near vertices are near, by scaling of distances to landmarks.

    Each landmark is the vertex farthest from those before.
    """
    count = graph.shape[0]
    source = int(np.argmax(np.nan_to_num(distances(graph, 0), posinf=count)))
    landmarks: list[int] = []
    squares: list[FloatArray] = []
    nearest = np.full(count, np.inf)
    for _ in range(min(LANDMARKS, count)):
        found = np.nan_to_num(distances(graph, source), posinf=count)
        landmarks.append(source)
        squares.append(found**2)
        nearest = np.minimum(nearest, found)
        source = int(np.argmax(nearest))
    between = np.array(squares)[:, landmarks]
    mean = between.mean(axis=0)
    values, vectors = np.linalg.eigh(-0.5 * (between - mean - mean[:, None] + mean.mean()))
    values, vectors = values[::-1][:3], vectors[:, ::-1][:, :3]
    scale = np.sqrt(np.maximum(values, FLAT * max(values[0], TINY)))
    return smoothed(graph, -0.5 * (np.array(squares).T - mean) @ (vectors / scale))


def smoothed(graph: SparseMatrix, coordinates: FloatArray) -> FloatArray:
    """Coordinates with those of each vertex drawn to the mean of its neighbours'."""
    ones = sparse.csc_array((np.ones(graph.nnz), graph.indices, graph.indptr), shape=graph.shape)
    degree = np.maximum(np.diff(graph.indptr), 1)[:, None]
    for _ in range(SMOOTHINGS):
        coordinates = 0.5 * (coordinates + times(ones, coordinates) / degree)
    return coordinates


def cut(
    graph: SparseMatrix, weights: IntArray, coordinates: FloatArray
) -> tuple[list[IntArray], list[tuple[int, ...]]]:
    """Vertices of every front, children first, and the numbers of each front's children."""
    groups: list[IntArray] = []
    children: list[tuple[int, ...]] = []
    place = np.full(graph.shape[0], -1, dtype=np.int32)

    def parted(part: IntArray) -> tuple[int, ...]:
        """Append the fronts of a part; the numbers of its topmost ones."""
        if weights[part].sum() <= LEAF or part.size == 1:
            groups.append(part)
            children.append(())
            return (len(groups) - 1,)
        edges = edges_within(graph, part, place)
        low, between = separator(edges, weights[part], coordinates[part])
        below = tuple(
            n for half in (low, ~low & ~between) if half.any() for n in parted(part[half])
        )
        if not between.any():
            return below
        groups.append(part[between])
        children.append(below)
        return (len(groups) - 1,)

    parted(np.arange(graph.shape[0]))
    return groups, children


def edges_within(graph: SparseMatrix, part: IntArray, place: IntArray) -> tuple[IntArray, IntArray]:
    """Both ends of all edges of a part, each both ways, by their places in it.

    ``place`` (n,) is -1 throughout, and is so again afterwards.
    """
    place[part] = np.arange(part.size)
    lengths = graph.indptr[part + 1] - graph.indptr[part]
    end = place[graph.indices[ranges(graph.indptr[part], lengths)]]
    begin = np.repeat(np.arange(part.size, dtype=np.int32), lengths)
    place[part] = -1
    return begin[end >= 0], end[end >= 0]


def separator(edges: Edges, weights: IntArray, coordinates: FloatArray) -> tuple[Mask, Mask]:
    """Which vertices of a part are on its low side, and which lie between its two sides.

    In a band across the middle of each long axis the lightest separators are found, and of these
    one is taken whose weight is small relative to the product of both sides.
    """
    extent = np.ptp(coordinates, axis=0)
    begin, end = edges
    count = weights.size
    total = float(weights.sum())
    lightest, found = np.inf, None
    for axis in np.flatnonzero(extent >= LONG * extent.max()):
        along = np.argsort(coordinates[:, axis], kind="stable")
        first = max(1, int((0.5 - BAND) * count))
        last = min(count - 1, math.ceil((0.5 + BAND) * count))
        side = np.empty(count, dtype=np.int8)
        side[along[:first]], side[along[first:last]], side[along[last:]] = LOW, MIDDLE, HIGH
        side[begin[(side[begin] == LOW) & (side[end] == HIGH)]] = MIDDLE
        for low, between in [(side == LOW, side == MIDDLE), *minimum_cuts(edges, side, weights)]:
            share, weight = weights[low].sum() / total, weights[between].sum() / total
            both = share * (1.0 - share - weight)
            worth = weight / both if both > 0.0 else np.inf
            if found is None or worth < lightest:
                lightest, found = worth, (low, between)
    assert found is not None
    return found


def minimum_cuts(
    edges: Edges, side: NDArray[np.int8], weights: IntArray
) -> list[tuple[Mask, Mask]]:
    """The lightest sets of vertices in the middle that part the low side from the high one.

    There are two of them, the nearest to either side; each with the vertices on its low side. They
    are the minimum cuts of a network whose vertices carry as much as they weigh [3]_.
    """
    begin, end = edges
    middle = np.flatnonzero(side == MIDDLE)
    size = middle.size
    number = np.full(side.size, -1, dtype=np.int32)
    number[middle] = np.arange(size)
    within = (number[begin] >= 0) & (number[end] >= 0)
    own = np.arange(size, dtype=np.int32)
    low, high = (
        np.unique(number[begin[(number[begin] >= 0) & (side[end] == s)]]) for s in (LOW, HIGH)
    )
    source, sink = 2 * size, 2 * size + 1  # the vertex i is entered at 2 i and left at 2 i + 1
    starts = [2 * number[begin[within]] + 1, 2 * own, np.full(low.size, source), 2 * high + 1]
    ends = [2 * number[end[within]], 2 * own + 1, 2 * low, np.full(high.size, sink)]
    most = np.iinfo(np.int32).max // 2
    free = np.full(low.size + high.size, most)
    carried = np.concatenate([np.full(np.count_nonzero(within), most), weights[middle], free])
    network = sparse.csr_array(
        (carried.astype(np.int32), (np.concatenate(starts), np.concatenate(ends))),
        shape=(2 * size + 2, 2 * size + 2),
    )
    left = sparse.csr_array(network - csgraph.maximum_flow(network, source, sink).flow)
    left.eliminate_zeros()
    found = []
    for residual, root in ((left, source), (sparse.csr_array(left.T), sink)):
        reached = np.zeros(2 * size + 2, dtype=bool)
        reached[csgraph.breadth_first_order(residual, root, return_predecessors=False)] = True
        entered, gone = reached[0:-2:2], reached[1:-2:2]
        before, between = side == LOW, np.zeros(side.size, dtype=bool)
        between[middle] = entered != gone
        before[middle] = gone if root == source else ~entered & ~gone
        found.append((before, between))
    return found


def fronts_of(
    graph: SparseMatrix,
    weights: IntArray,
    groups: list[IntArray],
    children: list[tuple[int, ...]],
) -> list[Front]:
    """The fronts with their borders, counted in rows."""
    order = np.concatenate(groups)
    place = np.empty(order.size, dtype=np.intp)
    place[order] = np.arange(order.size)
    row = np.concatenate([[0], np.cumsum(weights[order])])
    borders: list[IntArray] = []
    fronts: list[Front] = []
    start = 0
    for group, below in zip(groups, children, strict=True):
        stop = start + group.size
        lengths = graph.indptr[group + 1] - graph.indptr[group]
        near = place[graph.indices[ranges(graph.indptr[group], lengths)]]
        touched = np.unique(np.concatenate([near, *(borders[child] for child in below)]))
        border = touched[np.searchsorted(touched, stop) :]
        borders.append(border)
        rows = ranges(row[border], row[border + 1] - row[border])
        fronts.append(Front(int(row[start]), int(row[stop]), rows, below))
        start = stop
    return fronts
