"""The `where:` of a sweep: a small expression over the axes, not full Python."""

from __future__ import annotations

import ast
import operator
from typing import Any, Callable, Mapping, Sequence

_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda value, among: value in among,
    ast.NotIn: lambda value, among: value not in among,
}
_ARITHMETIC: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


class ExpressionError(Exception):
    """Invalid expression over the axes. The message names the error."""


class Where:
    """A condition on one cell: comparisons, and/or/not, + - * /, lists, numbers and texts."""

    def __init__(self, text: str, axes: Sequence[str]) -> None:
        """Raise ExpressionError for an unsupported expression, before any cell is expanded."""
        self._axes = axes
        try:
            self._root = ast.parse(text, mode="eval").body
        except (SyntaxError, ValueError) as error:
            raise ExpressionError(f"{text!r} is not an expression") from error
        self._check(self._root)

    def holds(self, values: Mapping[str, Any]) -> bool:
        """Whether a cell with these axis values is part of the experiment."""
        return bool(self._value(self._root, values))

    def _check(self, node: ast.AST) -> None:
        name = _dotted(node)
        if name is not None:
            if name not in self._axes:
                raise ExpressionError(f"no axis {name}; the axes are {', '.join(self._axes)}")
            return
        allowed = (
            isinstance(node, (ast.Constant, ast.BoolOp, ast.List, ast.Tuple))
            or (isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)))
            or (isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC)
            or (isinstance(node, ast.Compare) and all(type(op) in _COMPARISONS for op in node.ops))
        )
        if not allowed:
            raise ExpressionError(
                "use axes, numbers, texts, lists, comparisons, + - * /, and, or, not"
            )
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self._check(child)

    def _value(self, node: ast.expr, values: Mapping[str, Any]) -> Any:
        name = _dotted(node)
        if name is not None:
            return values[name]
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, (ast.List, ast.Tuple)):
            return [self._value(item, values) for item in node.elts]
        if isinstance(node, ast.BoolOp):
            each = (self._value(item, values) for item in node.values)
            return all(each) if isinstance(node.op, ast.And) else any(each)
        if isinstance(node, ast.UnaryOp):
            inner = self._value(node.operand, values)
            return not inner if isinstance(node.op, ast.Not) else -inner
        if isinstance(node, ast.BinOp):
            left, right = self._value(node.left, values), self._value(node.right, values)
            return _ARITHMETIC[type(node.op)](left, right)
        assert isinstance(node, ast.Compare)
        left = self._value(node.left, values)
        for op, right_node in zip(node.ops, node.comparators):
            right = self._value(right_node, values)
            if not _COMPARISONS[type(op)](left, right):
                return False
            left = right
        return True


def _dotted(node: ast.AST) -> str | None:
    """The dotted name of a chain of attributes, such as faults.kill.share, or None."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = _dotted(node.value)
        return None if before is None else f"{before}.{node.attr}"
    return None
