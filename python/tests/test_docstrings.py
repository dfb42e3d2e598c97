"""Every public function says what its parameters are, by the names that they have."""

import importlib
import inspect
import re
import types
from collections.abc import Iterator
from typing import Any

import pytest

import sheetsplat

#: Modules of the public interface, and what they need.
MODULES = {
    "sheetsplat": None,
    "sheetsplat.errors": None,
    "sheetsplat.dask": "distributed",
    "sheetsplat.napari": "napari",
    "sheetsplat.pytest_plugin": None,
    "sheetsplat.widget": "anywidget",
}

SECTIONS = {"Parameters", "Attributes", "Returns", "Yields", "Raises", "Examples", "Notes"}


def public(module: Any) -> Iterator[tuple[str, Any]]:
    """The public functions, classes and methods of a module by their names, and the golden fixture's class."""
    names = [*getattr(module, "__all__", []), *(["Golden"] if module.__name__.endswith("pytest_plugin") else [])]
    for name in names:
        value = getattr(module, name)
        if name != "Golden":
            # Only the fixture makes that one.
            yield name, value
        if inspect.isclass(value):
            for attribute, member in vars(value).items():
                if not attribute.startswith("_") or attribute == "__call__":
                    yield f"{name}.{attribute}", member


def sections(doc: str) -> dict[str, str]:
    """The text of each section of a docstring, and of what precedes them under an empty name."""
    found, name, lines = {}, "", doc.splitlines()
    text: list[str] = []
    at = 0
    while at < len(lines):
        if at + 1 < len(lines) and lines[at].strip() and re.fullmatch(r"-{3,}", lines[at + 1].strip()):
            found[name] = "\n".join(text).strip("\n")
            name, text = lines[at].strip(), []
            assert len(lines[at + 1].strip()) == len(name), f"{name}: the underline has another length"
            at += 2
            continue
        text.append(lines[at])
        at += 1
    found[name] = "\n".join(text).strip("\n")
    return found


def documented(text: str) -> list[str]:
    """The names of a section `Parameters`."""
    heads = [line.split(" : ")[0] for line in text.splitlines() if line and not line.startswith(" ")]
    return [name.strip() for head in heads for name in head.split(",")]


def expected(function: Any) -> list[str]:
    prefixes = {inspect.Parameter.VAR_KEYWORD: "**", inspect.Parameter.VAR_POSITIONAL: "*"}
    # A signature that names the words for completion has them as one parameter in its source.
    plain = types.FunctionType(function.__code__, function.__globals__, closure=function.__closure__)
    parameters = inspect.signature(plain).parameters.values()
    return [prefixes.get(one.kind, "") + one.name for one in parameters if one.name not in ("self", "cls")]


def problem(value: Any) -> str | None:
    """What is wrong with the docstring of a function, a method, a property or a class."""
    callable_ = value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
    is_function = inspect.isfunction(callable_)
    if not (is_function or inspect.isclass(value) or isinstance(value, property)):
        return None
    doc = inspect.cleandoc(value.__doc__ or "")
    parts = sections(doc)
    if not re.match(r"[A-Z`\"0-9].*[.?:]$", parts[""].partition("\n")[0]):
        return f"begins with no sentence: {parts[''][:60]!r}"
    if set(parts) - SECTIONS - {""}:
        return f"has unknown sections: {set(parts) - SECTIONS}"
    has_init = inspect.isclass(value) and "__init__" in vars(value) and not issubclass(value, Exception)
    if not (is_function or has_init):
        return None
    names = expected(callable_ if is_function else vars(value)["__init__"])
    found = documented(parts.get("Parameters", ""))
    return None if sorted(found) == sorted(names) else f"documents {found}, has {names}"


@pytest.mark.parametrize("name", MODULES)
def test_parameters_are_documented(name: str) -> None:
    if MODULES[name] is not None:
        pytest.importorskip(MODULES[name], reason=f"{MODULES[name]} is not installed")
    module = importlib.import_module(name)
    members = dict(public(module))
    problems = [f"{name}.{member} {wrong}" for member, value in members.items() if (wrong := problem(value))]
    assert not problems, "\n".join(problems)
    assert module.__doc__ and (members or name.endswith("plugin"))


def test_many_functions_were_looked_at() -> None:
    functions = [name for name, value in public(sheetsplat) if inspect.isfunction(value)]
    assert {"render", "orbit", "View.part", "View.set", "Scene.save", "Image.save"} <= set(functions)


def test_what_is_wrong_is_found() -> None:
    def without(a: int, *, b: int) -> None:
        """Does something.

        Parameters
        ----------
        a : int
            A number.
        """

    def other(a: int, **settings: int) -> None:
        """Does something.

        Parameters
        ----------
        a, **settings
            Numbers.
        """

    assert problem(without) == "documents ['a'], has ['a', 'b']"
    assert problem(other) is None
    assert "no sentence" in str(problem(lambda: None))
