"""The table of python/README.md: `compare.py PROGRAM [ROUNDS]`, where PROGRAM is the twin in Rust (`cargo build --release --example twin`).

Both run alternately, ROUNDS times (5); the least time of each problem counts.
"""

import json
import pathlib
import subprocess
import sys


def run(command):
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in text.splitlines()]


def main():
    here = pathlib.Path(__file__).parent
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    both = [(run([sys.executable, str(here / "problems.py")]), run([sys.argv[1]])) for _ in range(rounds)]
    print("| problem | Python [ms] | Rust [ms] | ratio |\n|---|---|---|---|")
    for of_problem in zip(*(zip(python, rust, strict=True) for python, rust in both)):
        for a, b in of_problem:
            # Both solve problems with the same numbers, so that results agree up to rounding.
            assert a["name"] == b["name"] and abs(a["result"] - b["result"]) < 1e-9, (a, b)
        times = [1e3 * min(pair[k]["seconds"] for pair in of_problem) for k in range(2)]
        print(f"| {of_problem[0][0]['name']} | {times[0]:.3g} | {times[1]:.3g} | {times[0] / times[1]:.2f} |")


if __name__ == "__main__":
    main()
