"""The package as it is installed: examples of its documentation, and stubs that say what there is."""

import ast
import doctest
import importlib.resources
import inspect
import types

import semismooth as ss
from semismooth import _core


def test_examples_of_functions_run():
    runner, count = doctest.DocTestRunner(), 0
    for name, text in [("", ss.__doc__)] + [(n, inspect.getdoc(getattr(ss, n))) for n in ss.__all__]:
        test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
        count += len(test.examples)
        runner.run(test)
    assert count > 10
    assert runner.summarize(verbose=False).failed == 0


def test_all_public_names_are_documented():
    for name in ss.__all__:
        assert inspect.getdoc(getattr(ss, name)), name


def test_stubs_name_what_there_is():
    assert importlib.resources.files(ss).joinpath("py.typed").is_file()
    tree = ast.parse(importlib.resources.files(ss).joinpath("_core.pyi").read_text(encoding="utf-8"))
    stubs = {n.name: n for n in tree.body if isinstance(n, (ast.ClassDef, ast.FunctionDef)) and not n.name.startswith("_")}
    assert set(stubs) == {n for n in vars(_core) if not n.startswith("_")}
    for name, stub in stubs.items():
        found = getattr(_core, name)
        if isinstance(stub, ast.ClassDef):
            described = {n.name for n in stub.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("_")}
            there = {n for n in vars(found) if not n.startswith("_")}
            assert described == there, name
        else:
            assert isinstance(found, types.BuiltinFunctionType)
            given = stub.args
            names = [a.arg for a in given.posonlyargs + given.args + given.kwonlyargs]
            names += [given.kwarg.arg] if given.kwarg else []
            assert names == list(inspect.signature(found).parameters), name
