"""The table of python/README.md: `compare.py PROGRAM`, where PROGRAM is the twin in Rust (`cargo build --release --example twin`)."""

import json
import pathlib
import subprocess
import sys


def run(command):
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in text.splitlines()]


def main():
    here = pathlib.Path(__file__).parent
    python, rust = run([sys.executable, str(here / "problems.py")]), run([sys.argv[1]])
    print("| problem | Python [ms] | Rust [ms] | ratio |\n|---|---|---|---|")
    for a, b in zip(python, rust, strict=True):
        # Matrices reach the solver with the same numbers: so do results, but for residuals of rounding.
        assert a["name"] == b["name"] and abs(a["result"] - b["result"]) < 1e-9, (a, b)
        times = [1e3 * t["seconds"] for t in (a, b)]
        print(f"| {a['name']} | {times[0]:.3g} | {times[1]:.3g} | {times[0] / times[1]:.2f} |")


if __name__ == "__main__":
    main()
