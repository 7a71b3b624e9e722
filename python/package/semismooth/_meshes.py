"""Meshes and fields between semismooth, numpy and meshio."""

from typing import Any

import numpy as np

from . import _core

#: Dimensions of the cell types of meshio that become cells or facets.
_DIMENSIONS = {
    "vertex": 0,
    **dict.fromkeys(["line", "line3"], 1),
    **dict.fromkeys(["triangle", "quad", "triangle6", "quad8", "quad9"], 2),
    **dict.fromkeys(["tetra", "hexahedron", "tetra10", "hexahedron20", "hexahedron27"], 3),
    **dict.fromkeys(["wedge", "pyramid", "wedge15", "pyramid13"], 3),
}


def _named_cells(mesh: Any) -> dict[str, list[Any]]:
    """Names, and for each block the cells in that group."""
    named: dict[str, list[Any]] = {}
    for name, blocks in mesh.cell_sets.items():
        # meshio's reader for Gmsh adds sets of its own, which are no names.
        if not name.startswith("gmsh:"):
            named[name] = [np.asarray([] if b is None else b, dtype=int) for b in blocks]
    tags = mesh.cell_data.get("gmsh:physical")
    for name, (tag, dimension) in mesh.field_data.items() if tags is not None else ():
        if name not in named:
            here = [_DIMENSIONS.get(b.type) == dimension for b in mesh.cells]
            named[name] = [np.flatnonzero(t == tag) if h else np.empty(0, int) for t, h in zip(tags, here)]
    return named


def _plane(points: Any) -> Any:
    """Points of a plane mesh without their third coordinate."""
    if points.shape[1] == 3:
        if np.ptp(points[:, 2]) > 1e-9 * max(np.ptp(points), np.finfo(float).tiny):
            raise _core.SemismoothError("the mesh has triangles or quadrilaterals alone, but does not lie in a plane z = constant")
        points = points[:, :2]
    return points


def from_meshio(mesh: Any) -> _core.Mesh:
    kinds = [b.type for b in mesh.cells]
    unknown = sorted(set(kinds) - set(_DIMENSIONS))
    if unknown:
        raise _core.SemismoothError(
            f"cells of kind {', '.join(unknown)} are not known: a mesh has {', '.join(k for k, d in _DIMENSIONS.items() if d > 1)}"
        )
    dimension = max((_DIMENSIONS[k] for k in kinds), default=0)
    if dimension < 2:
        raise _core.SemismoothError("the mesh has neither triangles nor quadrilaterals, tetrahedra nor hexahedra")
    own = [k for k, kind in enumerate(kinds) if _DIMENSIONS.get(kind) == dimension]
    nodes = np.unique(np.concatenate([np.ravel(mesh.cells[k].data) for k in own]))
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    points = np.asarray(mesh.points, dtype=float)[nodes]
    if dimension == 2:
        points = _plane(points)
    first = np.cumsum([0] + [len(mesh.cells[k].data) for k in own])
    groups: dict[str, Any] = {}
    facets: dict[str, list[list[int]]] = {}
    named_nodes: dict[str, Any] = {}
    for name, blocks in _named_cells(mesh).items():
        chosen = [blocks[k] + start for k, start in zip(own, first) if len(blocks[k])]
        if chosen:
            groups[name] = np.concatenate(chosen)
        sides = [k for k, kind in enumerate(kinds) if _DIMENSIONS.get(kind) == dimension - 1 and len(blocks[k])]
        found = [row for k in sides for row in number[mesh.cells[k].data[blocks[k]]].tolist()]
        if found:
            facets[name] = found
        ends = [number[mesh.cells[k].data[blocks[k]]] for k, kind in enumerate(kinds) if kind == "vertex" and len(blocks[k])]
        if ends:
            named_nodes[name] = _in_cells(np.concatenate(ends))
    cells = [(kinds[k], number[mesh.cells[k].data]) for k in own]
    for name, chosen in mesh.point_sets.items():
        if not name.startswith("gmsh:") and name not in named_nodes:
            named_nodes[name] = _in_cells(number[np.asarray(chosen, dtype=int)])
    made = _core.Mesh(points, cells, facets=facets, cell_groups=groups, nodes={n: k for n, k in named_nodes.items() if len(k)})
    return _with_point_sets(made, mesh, number)


def _in_cells(nodes: Any) -> Any:
    """Nodes that belong to a cell, each once."""
    nodes = np.unique(nodes)
    return nodes[nodes >= 0]


def _with_point_sets(made: _core.Mesh, mesh: Any, number: Any) -> _core.Mesh:
    """Named sets of points become the boundary facets that have all their nodes in the set, beside these nodes."""
    known = {name for name, _ in made.facets}
    sets = [(n, number[np.asarray(s, dtype=int)]) for n, s in mesh.point_sets.items() if n not in known and not n.startswith("gmsh:")]
    if not sets:
        return made
    everything = dict(made.with_boundary("all", lambda x, normal: np.full(len(x), True)).facets)["all"]
    for name, chosen in sets:
        inside = np.zeros(made.num_nodes, dtype=bool)
        inside[chosen[chosen >= 0]] = True
        if any(all(inside[n] for n in f) for f in everything):
            mask = np.array([all(inside[n] for n in f) for f in everything])
            made = made.with_boundary(name, lambda x, normal: mask)
    return made


def to_meshio(mesh: _core.Mesh, point_data: Any, cell_data: Any) -> Any:
    import meshio

    points = np.column_stack([mesh.points, np.zeros((mesh.num_nodes, 3 - mesh.dimension))])
    blocks = mesh.cells
    ends = np.cumsum([len(nodes) for _, nodes in blocks])[:-1]
    split = {name: np.split(np.asarray(values), ends) for name, values in (cell_data or {}).items()}
    sets = {}
    for name, cells in mesh.cell_groups:
        inside = np.zeros(mesh.num_cells, dtype=bool)
        inside[cells] = True
        sets[name] = [np.flatnonzero(part) for part in np.split(inside, ends)]
    return meshio.Mesh(points, blocks, point_data=dict(point_data or {}), cell_data=split, cell_sets=sets)


def _in_space(vectors: Any) -> Any:
    return np.column_stack([vectors, np.zeros((len(vectors), 3 - vectors.shape[1]))])


def point_data(solution: _core.ContactSolution) -> dict[str, Any]:
    problem = solution.problem
    assert problem.body is not None  # Without a mesh there are no fields: the caller has refused.
    count, nodes, areas = problem.body.mesh.num_nodes, problem.nodes, problem.areas[:, None]
    slip = sum(solution.slips[:, [k]] * t for k, t in enumerate(problem.tangents))
    along = sum(solution.tractions[:, [k]] * t for k, t in enumerate(problem.tangents))
    names = ["open", "stick", "slip+", "slip-"]
    fields: dict[str, tuple[Any, Any]] = {
        "contact state": (-1.0, [names.index(s) for s in solution.states]),
        "pressure": (0.0, solution.pressures / problem.areas),
        # λ acts from the body on the foundation.
        "traction": (np.zeros(3), _in_space(-(solution.pressures[:, None] * problem.normals + along) / areas)),
        "slip": (np.zeros(3), _in_space(slip)),
    }
    data = {"displacement": _in_space(solution.displacements)}
    for name, (elsewhere, values) in fields.items():
        data[name] = np.tile(elsewhere, (count, 1)) if np.ndim(elsewhere) else np.full(count, elsewhere)
        data[name][nodes] = values
    return data


def cell_data(solution: _core.ContactSolution) -> dict[str, Any]:
    stress = solution.stresses
    a, b, c = stress[:, 0], stress[:, 1], stress[:, 2]
    shear = np.sum(stress[:, 3:] ** 2, axis=1)
    return {
        "stress": stress,
        "von Mises stress": np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3 * shear),
    }
