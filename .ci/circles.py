#!/usr/bin/env python3
"""Circles of files of `src` that import each other: none of more than three files, but for the modules of `EXEMPT`. A file imports another one
if it names an item that is defined there, through whatever re-exports. Unit tests are left out."""
import re
import sys
from pathlib import Path

SRC = Path(__file__).resolve().parent.parent / "src"
LARGEST = 3
EXEMPT = {"continuation"}
USE = re.compile(r"^[ \t]*(?:pub(?:\([^)]*\))? )?use ([\w:{},*\s]+);", re.M)
ITEM = re.compile(r"\b(?:struct|enum|trait|fn|const|static|type|macro_rules!)\s+(\w+)")


def read():
    """Name of a module, as a tuple -> its code without comments and unit tests."""
    code = {}
    for file in SRC.rglob("*.rs"):
        if file.stem in ("tests", "testing"):
            continue
        parts = file.relative_to(SRC).with_suffix("").parts
        text = re.sub(r"//.*", "", file.read_text())
        text = re.sub(r"#\[cfg\(test\)\]\s*mod \w+ \{.*", "", text, flags=re.S)
        code[tuple(p for p in parts if p not in ("mod", "lib"))] = text
    return code


def leaves(tree, before=""):
    """The paths of a `use` tree."""
    head, brace, inner = tree.strip().partition("{")
    if not brace:
        return [before + head.split(" as ")[0].strip()]
    depth, start, found = 0, 0, []
    inner = inner[: inner.rindex("}")] + ","
    for k, c in enumerate(inner):
        depth += (c == "{") - (c == "}")
        if c == "," and depth == 0:
            found += leaves(inner[start:k], before + head) if inner[start:k].strip() else []
            start = k + 1
    return found


def graph(code):
    items = {name: set(ITEM.findall(text)) for name, text in code.items()}
    uses = {}
    for name, text in code.items():
        uses[name] = [path for tree in USE.findall(text) for path in leaves(tree)]
        uses[name] += re.findall(r"\b(?:crate|super|self)(?:::\w+)+", USE.sub("", text))

    def home(name, path, depth=0):
        """The module that defines what `path` means in the module `name`."""
        parts, at = path.split("::"), list(name)
        if parts[0] == "crate":
            at, parts = [], parts[1:]
        elif parts[0] not in ("super", "self") and tuple(at + parts[:1]) not in code:
            return None
        while parts and parts[0] in ("super", "self"):
            at, parts = at[: len(at) - (parts[0] == "super")], parts[1:]
        while parts and tuple(at + parts[:1]) in code:
            at, parts = at + parts[:1], parts[1:]
        if not parts or depth > 8 or tuple(at) not in code:
            return None
        if parts[0] not in items[tuple(at)]:
            for other in uses[tuple(at)]:
                if other != path and other.split("::")[-1] == parts[0]:
                    return home(tuple(at), other, depth + 1) or tuple(at)
        return tuple(at)

    edges = {name: set() for name in code}
    for name in code:
        for path in uses[name]:
            other = home(name, path)
            # A parent that re-exports what its children define does not depend on them by that.
            handed_on = rf"^[ \t]*pub[^;{{]*\buse [^;]*\b{path.split('::')[-1]}\b"
            below = other is not None and other[: len(name)] == name
            if other not in (None, name) and not (below and re.search(handed_on, code[name], re.M)):
                edges[name].add(other)
    return edges


def circles(edges):
    """Strongly connected components (R. Tarjan 1972)."""
    index, low, stack, found = {}, {}, [], []

    def visit(v):
        index[v] = low[v] = len(index)
        stack.append(v)
        for w in edges[v]:
            if w not in index:
                visit(w)
            if w in stack:
                low[v] = min(low[v], low[w])
        if low[v] == index[v]:
            k = stack.index(v)
            found.append(stack[k:])
            del stack[k:]

    sys.setrecursionlimit(10_000)
    for v in edges:
        if v not in index:
            visit(v)
    return found


def main():
    found = [c for c in circles(graph(read())) if len(c) > LARGEST and not {v[0] for v in c} <= EXEMPT]
    for circle in found:
        print(f"{len(circle)} files import each other: {', '.join('/'.join(v) for v in sorted(circle))}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
