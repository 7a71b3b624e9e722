#!/usr/bin/env python3
"""What ARCHITECTURE.md says of the structure of `src`, checked: the imports of its table, files of at most 600 lines, and, in modules whose
numbers are in a ledger, no numeric constants elsewhere. Unit tests are left out."""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SRC = ROOT / "src"
# Modules whose numbers are in a file `tolerances.rs`, those of one file in a folder of their own included.
LEDGERS = ["contact/delassus"]
NUMBER = re.compile(r"^\s*(?:pub(?:\([a-z: ]+\))? )?const ([A-Z_0-9]+): (?:f64|f32|usize|u32|u64|i32|\[(?:f64|usize); \d+\]) =")
TESTS = re.compile(r"^#\[cfg\((?:all\()?test")


def table():
    """Module -> those that it may import, from the table of ARCHITECTURE.md; and the modules that all may import."""
    rows = []
    for line in (ROOT / "ARCHITECTURE.md").read_text().splitlines():
        if line.startswith("| `") and line.count("|") >= 4:
            cells = [cell.strip() for cell in line.strip("|\n").split("|")]
            if len(cells) == 3:
                rows.append((re.findall(r"`(\w+)`", cells[0]), cells[2]))
        elif rows and not line.startswith("|"):
            break
    everywhere = set(rows[-1][0])
    said, above = {}, []
    for names, text in rows:
        said |= {name: (re.sub(r"\([^)]*\)", "", text), list(above)) for name in names}
        above += names

    def may_import(name):
        text, above = said[name]
        some, _, without = text.partition(" but ")
        may = set(re.findall(r"`(\w+)`", some)) | everywhere | {name}
        if "what is above" in some:
            # Those named, and all that these may import.
            may |= {further for other in may - everywhere - {name} for further in may_import(other)}
        if "all of the above" in some:
            may |= set(above)
        return may - set(re.findall(r"`(\w+)`", without))

    return {name: may_import(name) for name in said}, everywhere


def code(file):
    """Lines of a file before its unit tests, with their numbers, without comments."""
    for number, line in enumerate(file.read_text().splitlines(), 1):
        if TESTS.match(line):
            return
        if not line.lstrip().startswith("//"):
            yield number, line


def main():
    found = []
    allowed, everywhere = table()
    for name, may in allowed.items():
        for other in sorted(may - everywhere - {name}):
            if name not in everywhere and name in allowed[other] and name < other:
                found.append(f"ARCHITECTURE.md: `{name}` and `{other}` may import each other")
    for file in sorted(SRC.rglob("*.rs")):
        name = file.relative_to(SRC)
        if file.read_text().count("\n") > 600:
            found.append(f"{name}: more than 600 lines")
        if name.stem == "tests":
            continue
        module = name.parts[0].removesuffix(".rs")
        if module != "lib" and module not in allowed:
            found.append(f"{name}: the table of ARCHITECTURE.md does not name this module")
        for number, line in code(file):
            for other in re.findall(r"\bcrate::(\w+)", line):
                if other in allowed and module in allowed and other not in allowed[module]:
                    found.append(f"{name}:{number}: `{module}` may not import `{other}`: {line.strip()}")
            in_ledger = any(name.is_relative_to(ledger) for ledger in LEDGERS) and name.name != "tolerances.rs"
            if in_ledger and (constant := NUMBER.match(line)):
                found.append(f"{name}:{number}: {constant[1]} belongs into the ledger of its module, tolerances.rs")
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
