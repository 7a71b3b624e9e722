#!/usr/bin/env python3
"""Contact in space by PETSc's algebraic multigrid, compared with the crate's own, on the same body in the same run.

    python3 benches/peers/petsc_contact/compare.py [--cells 40x38x20] [--cells 88x84x44] [--runs 1] [options of PETSc]

A block fixed at the left, pressed on top, pulled at the right, on a foundation with F = 0.3: the program `large` of `petsc/` on one
process (Newton's method and the laws of `semismooth`; matrices, GAMG and GMRES of PETSc) and the example `contact_size --route
displacements` on one thread, one after the other, --runs times. Both solve at α = 1 from zero, then at α = 1.05 from that solution, to the
same tolerance. Prints processor time (user and system) and peak memory of each whole program, including mesh and assembly; the least of
several runs. Builds both; needs PETSc, MPI and the tools in petsc/README.md.
"""

import argparse
import os
import re
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
TARGET = os.path.join(ROOT, "target")


def build():
    """Builds both programs and returns their paths."""
    petsc = os.path.join(ROOT, "petsc", "Cargo.toml")
    subprocess.run(
        ["cargo", "build", "--release", "--manifest-path", petsc, "--target-dir", TARGET, "--bin", "large"],
        check=True,
        cwd=ROOT,
    )
    subprocess.run(["cargo", "build", "--release", "--example", "contact_size"], check=True, cwd=ROOT)
    return os.path.join(TARGET, "release", "large"), os.path.join(TARGET, "release", "examples", "contact_size")


def run(command, environment):
    """The output of a program, its processor time in seconds and its peak resident set in MiB."""
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as program:
        said = program.stdout.read()
        _, status, usage = os.wait4(program.pid, 0)
        program.returncode = os.waitstatus_to_exitcode(status)
    if program.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{said}")
    return said, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def of_petsc(said):
    """Displacements, contact nodes, Newton steps and GMRES iterations of both loads, states at the second."""
    size = re.search(r"(\d+) displacements, (\d+) contact nodes", said)
    loads = re.findall(r"(\d+) Newton, (\d+) GMRES, \[(\d+), (\d+), (\d+)\]", said)
    (first, second) = loads
    return size.groups(), f"{first[0]}+{second[0]}", f"{first[1]}+{second[1]}", second[2:]


def of_crate(said):
    """The same from the output of `contact_size`: its row, and the line below."""
    row = re.search(r"^ *\d+x\d+x\d+ .*$", said, re.MULTILINE).group().split()
    states = re.search(r"open (\d+), stick (\d+), slip (\d+)", said)
    return (row[1], row[2]), row[9], row[10], states.groups()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", action="append", help="NXxNYxNZ, more than once; default 40x38x20")
    parser.add_argument("--runs", type=int, default=1)
    arguments, options = parser.parse_known_args()
    large, contact_size = build()
    environment = dict(os.environ, RAYON_NUM_THREADS="1", OMP_NUM_THREADS="1")
    environment.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    load = os.getloadavg()[0]
    print(f"load at the start {load:.1f}")
    print("displacements contacts  program          CPU s      MiB   Newton    GMRES   open, stick, slip")
    for cells in arguments.cells or ["40x38x20"]:
        programs = {
            "PETSc": ([large, cells, *options], of_petsc),
            "semismooth": ([contact_size, "--solid", cells, "--route", "displacements"], of_crate),
        }
        best = {}
        for _ in range(arguments.runs):
            for name, (command, read) in programs.items():
                said, seconds, memory = run(command, environment)
                if name not in best or seconds < best[name][0]:
                    best[name] = (seconds, memory, read(said))
        for name, (seconds, memory, (size, newton, krylov, states)) in best.items():
            print(
                f"{size[0]:>13} {size[1]:>8}  {name:<12} {seconds:9.1f} {memory:8.0f} {newton:>8} {krylov:>8}   "
                + ", ".join(states)
            )
        if len({found[2][3] for found in best.values()}) > 1:
            sys.exit("the states of the nodes differ")
        print(f"{'':24}PETSc takes {best['PETSc'][0] / best['semismooth'][0]:.1f} times the processor time, "
              f"{best['PETSc'][1] / best['semismooth'][1]:.1f} times the memory")


if __name__ == "__main__":
    main()
