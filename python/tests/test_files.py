"""Meshes and problems in formats of others: meshio's and fclib's."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import semismooth as ss

DATA = Path(__file__).parents[2] / "tests" / "data"


def pressed(mesh):
    d = mesh.dimension
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"top": [0.001] + [0.0] * (d - 2) + [-0.02]})
    return ss.ContactProblem(body, "bottom", ss.Foundation.plane([0.0] * d, [0.0] * (d - 1) + [1.0]), 0.3).solve()


def own(kind):
    return {
        "quad": ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]),
        "triangle": ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]).simplices(),
        "hexahedron": ss.Mesh.block([0, 0, 0], [2, 1, 1], [3, 2, 2]),
        "tetra": ss.Mesh.block([0, 0, 0], [2, 1, 1], [3, 2, 2]).simplices(),
        "triangle6": ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]).simplices().second_order(),
        "quad8": ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]).serendipity(),
        "quad9": ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]).second_order(),
        "tetra10": ss.Mesh.block([0, 0, 0], [2, 1, 1], [2, 1, 1]).simplices().second_order(),
        "hexahedron20": ss.Mesh.block([0, 0, 0], [2, 1, 1], [2, 2, 1]).serendipity(),
        "hexahedron27": ss.Mesh.block([0, 0, 0], [2, 1, 1], [2, 2, 1]).second_order(),
        "wedge": cut("wedge"),
        "wedge15": cut("wedge").second_order(),
        "pyramid": cut("pyramid"),
        "pyramid13": cut("pyramid").serendipity(),
    }[kind]


def cut(kind):
    """Cubes cut into two wedges each, or into six pyramids around their centres."""
    block = ss.Mesh.block([0, 0, 0], [2, 1, 1], [2, 2, 1])
    cubes, points = block.cells[0][1], block.points
    if kind == "wedge":
        cells = np.vstack([cubes[:, [0, 1, 2, 4, 5, 6]], cubes[:, [0, 2, 3, 4, 6, 7]]])
    else:
        sides = [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
        centres = len(points) + np.arange(len(cubes))
        cells = np.vstack([np.column_stack([cubes[:, side], centres]) for side in sides])
        points = np.vstack([points, points[cubes].mean(axis=1)])
    mesh = ss.Mesh(points, {kind: cells})
    return mesh.with_boundary("bottom", lambda x, normal: normal[:, 2] < -0.5).with_boundary("top", lambda x, normal: normal[:, 2] > 0.5)


KINDS = [
    "quad",
    "triangle",
    "hexahedron",
    "tetra",
    "triangle6",
    "quad8",
    "quad9",
    "tetra10",
    "hexahedron20",
    "hexahedron27",
    "wedge",
    "pyramid",
]
#: Kinds of facets by the dimension of the mesh and the number of their nodes.
FACETS = {
    **{(2, 2): "line", (2, 3): "line3", (3, 3): "triangle", (3, 4): "quad"},
    **{(3, 6): "triangle6", (3, 8): "quad8", (3, 9): "quad9"},
}


def with_facets(mesh, facets):
    """A mesh of meshio with facets as cells of their own, in named sets."""
    meshio = pytest.importorskip("meshio")
    plain = mesh.to_meshio()
    blocks, sets = list(plain.cells), {}
    for name in ("top", "bottom"):
        rows = np.array(facets[name])
        kind = FACETS[mesh.dimension, rows.shape[1]]
        blocks.append(meshio.CellBlock(kind, rows))
        sets[name] = len(blocks) - 1
    named = {n: [np.arange(len(b.data)) if k == own else np.empty(0, int) for k, b in enumerate(blocks)] for n, own in sets.items()}
    # A node of no cell, as some programs write.
    points = np.vstack([plain.points, [[7.0, 7.0, plain.points[0, 2]]]])
    return meshio.Mesh(points, blocks, cell_sets=named)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("route", ["cell sets", "gmsh", "abaqus", "point sets"])
def test_meshes_of_meshio_give_the_same_solution(kind, route, tmp_path):
    meshio = pytest.importorskip("meshio")
    if route == "abaqus" and kind in ("hexahedron27", "pyramid"):
        pytest.skip("meshio writes no such cells")
    mesh = own(kind)
    expected = pressed(mesh)
    facets = dict(mesh.facets)
    given = with_facets(mesh, facets)
    if route == "gmsh":
        given.field_data = {"top": np.array([1, mesh.dimension - 1]), "bottom": np.array([2, mesh.dimension - 1])}
        tags = []
        for k, block in enumerate(given.cells):
            name = next((n for n, s in given.cell_sets.items() if len(s[k])), None)
            tags.append(np.full(len(block.data), {"top": 1, "bottom": 2, None: 3}[name]))
        given.field_data["body"] = np.array([3, mesh.dimension])
        given = meshio.Mesh(given.points, given.cells, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags}, field_data=given.field_data)
        given.write(tmp_path / "mesh.msh", file_format="gmsh22", binary=False)
        given = meshio.read(tmp_path / "mesh.msh")
        # meshio's numbering of nodes, and ours of those of the file.
        cells = ss.Mesh.read_gmsh(tmp_path / "mesh.msh").cells
        assert cells[0][0] == kind
        np.testing.assert_array_equal(cells[0][1], mesh.cells[0][1])
    elif route == "abaqus":
        plain = mesh.to_meshio()
        plain.point_sets = {n: np.unique(facets[n]) for n in ("top", "bottom")}
        plain.write(tmp_path / "mesh.inp")
        given = meshio.read(tmp_path / "mesh.inp")
    elif route == "point sets":
        given = mesh.to_meshio()
        given.point_sets = {n: np.unique(facets[n]) for n in ("top", "bottom")}
        given.point_sets["inside"] = np.array([0])
    found = ss.Mesh.from_meshio(given)
    assert found.dimension == mesh.dimension and found.num_nodes == mesh.num_nodes
    names = {n for n, _ in found.facets}
    assert {"top", "bottom"} <= names and "inside" not in names
    if route in ("abaqus", "point sets"):
        assert set(dict(found.nodes)["top"]) == set(np.unique(facets["top"]).tolist())
    solution = pressed(found)
    np.testing.assert_allclose(solution.pressures, expected.pressures, rtol=1e-9)
    np.testing.assert_allclose(solution.displacements, expected.displacements, rtol=0, atol=1e-12)


def test_materials_of_blocks_and_sets():
    pytest.importorskip("meshio")
    mesh = own("quad").with_cells("hard", lambda x: x[:, 0] < 1)
    again = ss.Mesh.from_meshio(mesh.to_meshio())
    assert again.cell_groups == mesh.cell_groups
    np.testing.assert_array_equal(again.points, mesh.points)


@pytest.mark.parametrize("kind", ["wedge15", "pyramid13"])
def test_cells_that_meshio_5_does_not_hold_have_its_names(kind):
    mesh = own(kind)
    assert [name for name, _ in mesh.cells] == [kind]
    again = ss.Mesh(mesh.points, dict(mesh.cells), facets=dict(mesh.facets))
    np.testing.assert_array_equal(pressed(again).displacements, pressed(mesh).displacements)


def test_pictures_show_the_deformed_body_and_the_states():
    solution = pressed(own("quad"))
    svg = solution.to_svg(magnification=10.0)
    # Cells, and the outline before.
    assert svg.startswith("<svg") and svg.count("<polygon") >= solution.problem.body.mesh.num_cells
    assert svg != solution.to_svg() and ">stick<" in svg and "von Mises" in svg


def corners(svg):
    """The corners of the polygons of a picture, in pixels."""
    return [np.array([p.split(",") for p in text.split(" ")], float) for text in re.findall(r'<polygon[^>]* points="([^"]*)"', svg)]


def test_meshes_draw_themselves(tmp_path):
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2])
    picture = mesh.plot(groups=["bottom", "left"])
    cells = corners(picture)
    assert len(cells) == 8 and picture._repr_svg_() == picture
    # Each cell is a square: of the same size, in one scale.
    sides = np.array([np.ptp(c, axis=0) for c in cells])
    np.testing.assert_allclose(sides, sides[0, 0], atol=0.03)
    # Five nodes below and three at the left.
    assert picture.count('r="4"') == 8 and ">bottom<" in picture and ">left<" in picture
    picture.save(tmp_path / "mesh.svg")
    assert (tmp_path / "mesh.svg").read_text(encoding="utf-8") == picture
    with pytest.raises(ss.SemismoothError, match="nowhere"):
        mesh.plot(groups=["nowhere"])
    # Of a cube three sides are seen, from above among them the nine nodes of the top.
    cube = ss.Mesh.block([0, 0, 0], [1, 1, 1], [2, 2, 2])
    assert len(corners(cube.plot())) == 12
    above, below = (cube.plot(groups=["top"], view=(-60, sign * 30)) for sign in (1, -1))
    assert [p.count('r="4"') for p in (above, below)] == [9, 5]


def test_every_level_of_a_history_can_be_drawn():
    body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
    problem = ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), 0.4, rate=body.motion("top", [0.05, None]))
    steps = ss.evolve(problem, problem.solve(0.0), [0.5, 1.0, 0.0])
    for step in steps:
        _, stick, slip = step.solution.counts
        picture = step.solution.plot()
        assert (">stick<" in picture, ">slip<" in picture) == (stick > 0, slip > 0)
    # Displacements are seen, and of up to a tenth of the body's size.
    assert [steps[k].solution.plot() == steps[k].solution.plot(magnification=m) for k, m in enumerate([5.0, 2.0])] == [True, True]


@pytest.mark.parametrize("kind", KINDS)
def test_fields_come_back_from_a_file(kind, tmp_path):
    meshio = pytest.importorskip("meshio")
    solution = pressed(own(kind))
    problem = solution.problem
    solution.to_meshio().write(tmp_path / "solution.vtu")
    read = meshio.read(tmp_path / "solution.vtu")
    d = problem.body.mesh.dimension
    np.testing.assert_array_equal(read.point_data["displacement"][:, :d], solution.displacements)
    traction, areas = read.point_data["traction"], problem.areas
    # What the foundation does to the body: forces and their balance with the supports.
    forces = (traction[problem.nodes] * areas[:, None]).sum(axis=0)
    np.testing.assert_allclose(forces[:d], -solution.reactions.sum(axis=0), rtol=0, atol=1e-14)
    assert forces[d - 1] == pytest.approx(solution.pressures.sum()) and forces[0] < 0
    state = read.point_data["contact state"]
    assert np.count_nonzero(state >= 0) == problem.num_contacts
    np.testing.assert_array_equal(state[problem.nodes] == 0, np.array(solution.states) == "open")
    np.testing.assert_array_equal(read.point_data["pressure"][problem.nodes], solution.pressures / areas)
    stress = np.concatenate(read.cell_data["stress"])
    np.testing.assert_array_equal(stress, solution.stresses)
    # Of the deviator, by another formula.
    a, b, c, ab, bc, ac = stress.T
    tensor = np.array([[a, ab, ac], [ab, b, bc], [ac, bc, c]])
    deviator = tensor - np.einsum("kk...->...", tensor) / 3 * np.eye(3)[:, :, None]
    mises = np.sqrt(1.5 * np.einsum("ij...,ij...->...", deviator, deviator))
    np.testing.assert_allclose(np.concatenate(read.cell_data["von Mises stress"]), mises, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda m: m.cells.append(m.cells[0].__class__("wedge18", np.zeros((1, 18), int))), "wedge18"),
        (lambda m: m.cells.clear(), "neither"),
        (lambda m: m.points.__setitem__((0, 2), 0.5), "plane"),
    ],
)
def test_meshes_that_do_not_serve_are_refused(change, says):
    pytest.importorskip("meshio")
    mesh = own("quad").to_meshio()
    change(mesh)
    with pytest.raises(ss.SemismoothError, match=says):
        ss.Mesh.from_meshio(mesh)


def write_fclib(path, problem, storage, solution=None):
    """As fclib writes a local problem."""
    h5py = pytest.importorskip("h5py")
    from scipy import sparse

    size = problem["nc"] * problem["dimension"]
    m = problem["M"]
    matrix = sparse.csc_matrix((m["data"], m["indices"], m["indptr"]), shape=(size, size))
    stored = {-1: matrix, -2: matrix.tocsr()}.get(storage, matrix.tocoo())
    with h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"] = np.array([problem["dimension"]], dtype=np.int32)
        w = local.create_group("W")
        if storage == 0:
            fields = {"p": stored.col, "i": stored.row, "nz": [stored.nnz]}
        else:
            fields = {"p": stored.indptr, "i": stored.indices, "nz": [storage]}
        for name, values in (fields | {"m": [size], "n": [size], "nzmax": [stored.nnz]}).items():
            w[name] = np.array(values, dtype=np.int32)
        w["x"] = stored.data
        local["vectors/q"], local["vectors/mu"] = np.array(problem["q"]), np.array(problem["mu"])
        if solution is not None:
            file["solution/u"], file["solution/r"] = (np.ravel(v) for v in solution)
    return matrix


@pytest.mark.parametrize("storage", [-1, -2, 0])
@pytest.mark.parametrize("name", ["Rover4396", "FC2D_SliderCrankLagrangian00000"])
def test_problems_of_fclib(name, storage, tmp_path):
    given = json.loads((DATA / "friction" / f"{name}.json").read_text())
    result = None
    for _ in range(2):
        matrix = write_fclib(tmp_path / "problem.hdf5", given, storage, result)
        problem = ss.read_fclib(tmp_path / "problem.hdf5")
        assert (problem.M != matrix).nnz == 0 and problem.dimension == given["dimension"]
        solved = ss.solve_friction(*problem[:3])
        assert solved.solved
        if result is None:
            assert problem.solution is None
        else:
            np.testing.assert_array_equal(problem.solution[0], solved.velocities)
            np.testing.assert_array_equal(problem.solution[1], solved.reactions)
        result = (solved.velocities, solved.reactions)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f.move("fclib_local", "fclib_global"), "no group fclib_local"),
        (lambda f: f["fclib_local"].create_group("V"), "equality"),
        (lambda f: f["fclib_local/W"].attrs.create("symmetric_packed", 1), "triangle"),
        (lambda f: f["fclib_local/W/nz"].write_direct(np.array([-7], dtype=np.int32)), "nz = -7"),
        (lambda f: f["fclib_local/spacedim"].write_direct(np.array([2], dtype=np.int32)), "do not fit"),
    ],
)
def test_other_files_of_fclib_are_refused(change, says, tmp_path):
    h5py = pytest.importorskip("h5py")
    given = json.loads((DATA / "friction" / "Rover4396.json").read_text())
    write_fclib(tmp_path / "problem.hdf5", given, -1)
    with h5py.File(tmp_path / "problem.hdf5", "r+") as file:
        change(file)
    with pytest.raises(ss.SemismoothError, match=says):
        ss.read_fclib(tmp_path / "problem.hdf5")
