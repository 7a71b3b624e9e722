#!/usr/bin/python3
"""GetFEM's continuation and that of this crate on the same matrices: transitions, folds, wall time, ratio.

    cargo build --release --example follow_load
    /usr/bin/python3 benches/peers/getfem_continuation.py [FOLDER]

FOLDER holds a discrete problem as `follow_load` reads it; default: the one in examples/data. Needs the Debian package
python3-getfem; without it the comparison is skipped with a message.
"""

import json
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]


def ours(folder):
    program = ROOT / "target" / "release" / "examples" / "follow_load"
    if not program.exists():
        sys.exit("build it first: cargo build --release --example follow_load")
    out = subprocess.run(
        [program, folder, "--json", "--out", ROOT / "target" / "peers"], check=True, capture_output=True, text=True
    ).stdout
    return json.loads(out.splitlines()[-1])["summary"]


def peer(gf, np, folder):
    """GetFEM's Moore-Penrose continuation with a basic contact brick on the given matrices, γ from 0 until it leaves [0, 1]."""
    read = lambda name: gf.Spmat("load", "mm", str(folder / name))
    meta = json.loads((folder / "meta.json").read_text())
    start, end, gap = (np.loadtxt(folder / name, ndmin=1) for name in ("f0.txt", "f1.txt", "gap.txt"))
    stiffness, normal, tangential = read("A.mtx"), read("Bnu.mtx"), read("Bt.mtx")
    n, p = stiffness.size()[0], normal.size()[0]

    model = gf.Model("real")
    for name, size in (("u", n), ("lambda_n", p), ("lambda_t", p)):
        model.add_variable(name, size)
    data = {"gamma": [0.0], "f0": start, "f1": end, "f": start, "r": [meta.get("r", 1.0)], "gap": gap}
    for name, value in data.items():
        model.add_initialized_data(name, value)
    friction = meta["friction"]
    model.add_initialized_data("friction", [friction] * p if isinstance(friction, (int, float)) else friction)
    model.add_initialized_data("alpha", [1.0] * p)
    model.add_explicit_matrix("u", "u", stiffness)
    # A load of a variable without mesh: integrated over an interval of length 1.
    mesh = gf.Mesh("cartesian", [0, 1])  # has to outlive what is defined on it
    unit = gf.MeshIm(mesh, gf.Integ("IM_GAUSS1D(1)"))
    model.add_source_term(unit, "f.Test_u")
    model.add_basic_contact_brick(
        "u", "lambda_n", "lambda_t", "r", normal, tangential, "friction", "gap", "alpha", 1
    )
    model.solve("max_res", 1e-12, "max_iter", 200)

    # Options with which GetFEM follows the branches of these problems to their end; with larger steps it leaves the branch.
    options = meta.get("getfem", {}).get("opts") or {
        "h_init": 5e-4, "h_max": 1e-1, "h_min": 5e-7, "max_iter": 5, "thr_iter": 4,
        "max_res": 5e-10, "max_diff": 5e-10, "min_cos": 0.99999, "max_res_solve": 1e-10,
    }
    flat = [v for pair in options.items() for v in pair]
    curve = gf.ContStruct(
        model, "gamma", "f0", "f1", "f", 1.0 / model.nbdof(), "singularities", 1, "non-smooth", *flat
    )
    x, gamma = model.from_variables(), 0.0
    tangent, tangent_gamma, h = curve.init_Moore_Penrose_continuation(x, gamma, 1.0)
    count, folds = 0, []
    while -1e-9 <= gamma <= 1.0 and h > 0.0 and count < 20000:
        x, gamma, tangent, tangent_gamma, h, _, label = curve.Moore_Penrose_continuation(
            x, gamma, tangent, tangent_gamma, h
        )
        count += 1
        if label and "limit" in label:
            folds.append(gamma)
    return {"steps": count, "folds": folds, "end": "left the interval" if h > 0.0 else "step too small", "gamma": gamma}


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("-")]
    folder = pathlib.Path(arguments[0]) if arguments else ROOT / "examples/data/block_linear_10x20_F0.5"
    mine = ours(folder)
    print(f"semismooth: {mine['transitions']} transitions, folds {mine['folds']}, {mine['factorisations']} factorisations, "
          f"{mine['seconds'] * 1e3:.2f} ms, end: {mine['end']}")
    try:
        import getfem as gf
        import numpy as np
    except ImportError:
        print("GetFEM is not installed (Debian: python3-getfem); comparison skipped")
        return
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    begun = time.perf_counter()
    theirs = peer(gf, np, folder)
    seconds = time.perf_counter() - begun
    print(f"GetFEM: no transitions named, {theirs['steps']} steps, folds {theirs['folds']}, {seconds:.2f} s, "
          f"end: {theirs['end']} at {theirs['gamma']:.6f}")
    print(f"ratio: {seconds / mine['seconds']:.0f}")


if __name__ == "__main__":
    main()
