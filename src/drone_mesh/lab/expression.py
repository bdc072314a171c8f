"""The `where:` of a sweep: a small expression over the axes, not full Python."""

from __future__ import annotations

import ast
import re
import reprlib
from typing import Any, Mapping, Sequence

_ALLOWED = (
    ast.Expression, ast.Constant, ast.List, ast.Tuple, ast.Load,
    ast.BoolOp, ast.boolop, ast.UnaryOp, ast.Not, ast.USub,
    ast.Compare, ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn,
)  # fmt: skip


MOST_CHARACTERS = 1_000


class ExpressionError(Exception):
    """Invalid expression over the axes. The message names the error."""


class Where:
    """A condition on one cell: comparisons, and/or/not, lists, numbers and texts."""

    def __init__(self, text: str, axes: Sequence[str]) -> None:
        """Raise ExpressionError for an unsupported expression, before any cell is expanded."""
        if len(text) > MOST_CHARACTERS:
            raise ExpressionError(f"longer than {MOST_CHARACTERS} characters")
        try:
            tree = ast.parse(text, mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            hint = ""
            if re.search(r"\w\.\d+\.", text):  # as in faults.0.kill.share
                hint = "; name the action, not the number of a fault, as in faults.kill.share"
            raise ExpressionError(f"{text!r} is not an expression{hint}") from error
        try:
            checked = ast.fix_missing_locations(_OverAxes(axes).visit(tree))
            self._code = compile(checked, "where", "eval")
        except (ValueError, RecursionError, MemoryError) as error:
            raise ExpressionError("nested too deeply") from error

    def holds(self, values: Mapping[str, Any]) -> bool:
        """Whether a cell with these axis values is part of the experiment.

        Raises ExpressionError for values that it cannot compare.
        """
        try:
            return bool(eval(self._code, {"__builtins__": {}}, dict(values)))  # calls nothing
        except (TypeError, RecursionError) as error:
            raise ExpressionError(f"{error}, with {reprlib.repr(dict(values))}") from error


class _OverAxes(ast.NodeTransformer):
    """Makes each chain of attributes, such as faults.kill.share, one variable; checks the rest."""

    def __init__(self, axes: Sequence[str]) -> None:
        self._axes = axes

    def visit(self, node: ast.AST) -> Any:
        name = _dotted(node)
        if name is not None:
            if name not in self._axes:
                axes = ", ".join(self._axes) or "none: nothing is swept"
                raise ExpressionError(f"no axis {name}; the axes are {axes}")
            return ast.copy_location(ast.Name(name, ast.Load()), node)
        if not isinstance(node, _ALLOWED):
            raise ExpressionError("use axes, numbers, texts, lists, comparisons, and, or, not")
        if isinstance(node, ast.Tuple):  # the values of axes are lists
            node = ast.copy_location(ast.List(node.elts, node.ctx), node)
        return self.generic_visit(node)


def _dotted(node: ast.AST) -> str | None:
    """The name that a chain of attributes spells, with dots; None for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = _dotted(node.value)
        return None if before is None else f"{before}.{node.attr}"
    return None
