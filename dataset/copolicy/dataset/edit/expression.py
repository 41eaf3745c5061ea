"""Conditions on episode columns, such as `duration_s < 20 and source == "human"`, parsed and never run as Python."""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

from ..exceptions import InvalidValueError, UnknownNameError

Row = Mapping[str, Any]
Condition = Callable[[Row], Any]

GRAMMAR = "comparisons of episode columns with ==, !=, <, <=, >, >=, in, joined by and, or, not and brackets"

_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda value, values: value in values,
    ast.NotIn: lambda value, values: value not in values,
}
_LITERALS = (str, int, float, bool)


def parse_condition(text: str, columns: Mapping[str, str], flag: str = "--where") -> Condition:
    """The condition as a function of an episode's row.

    Numbers are compared with numbers and texts with texts; `in` asks for one of several values
    (`map_id in ("training-01", "training-02")`) or a part of a text (`"slow" in quality_flags`). A column of flags
    stands for itself (`success and not discarded`). What is unknown (null, NaN) equals nothing and is in no order.

    Args:
        columns: `str`, `int`, `float` or `bool` of each column that may be named.

    Raises:
        InvalidValueError: another form, or values of two types compared.
        UnknownNameError: no such column.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
        return _flag(tree.body, columns, text, flag)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InvalidValueError(flag, GRAMMAR, text) from None


def _flag(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> Condition:
    """A part of the expression that is true or false."""
    if isinstance(node, ast.BoolOp):
        parts = [_flag(value, columns, text, flag) for value in node.values]
        combine = all if isinstance(node.op, ast.And) else any
        return lambda row: combine(part(row) for part in parts)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        inner = _flag(node.operand, columns, text, flag)
        return lambda row: not inner(row)
    if isinstance(node, ast.Compare):
        return _comparison(node, columns, text, flag)
    kind, value = _value(node, columns, text, flag)
    if kind != "bool":
        raise InvalidValueError(flag, "a comparison, or a column of flags such as success", ast.unparse(node))
    return lambda row: bool(value(row))


def _comparison(node: ast.Compare, columns: Mapping[str, str], text: str, flag: str) -> Condition:
    parts: list[Condition] = []
    left = node.left
    for comparison, right in zip(node.ops, node.comparators, strict=True):
        compare = _COMPARISONS.get(type(comparison))
        if compare is None:
            raise InvalidValueError(flag, GRAMMAR, text)
        kind, first = _value(left, columns, text, flag)
        if isinstance(comparison, (ast.In, ast.NotIn)):
            kinds, second = _values(right, columns, text, flag)
        else:
            right_kind, second = _value(right, columns, text, flag)
            kinds = {right_kind}
        if not all(_comparable(kind, right_kind) for right_kind in kinds):
            found = f"{kind} compared with {', '.join(sorted(kinds))} in {ast.unparse(node)}"
            raise InvalidValueError(flag, "values of one type in a comparison", found)
        unknown = isinstance(comparison, (ast.NotEq, ast.NotIn))
        parts.append(_known(compare, first, second, unknown))
        left = right
    return lambda row: all(part(row) for part in parts)


def _known(compare: Callable[[Any, Any], bool], first: Condition, second: Condition, unknown: bool) -> Condition:
    def compared(row: Row) -> bool:
        a, b = first(row), second(row)
        return unknown if a is None or b is None else compare(a, b)

    return compared


def _values(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> tuple[set[str], Condition]:
    """What may stand behind `in`: some values, or a text of which the left side is a part."""
    if isinstance(node, (ast.Tuple, ast.List, ast.Set)):
        kinds, values = set(), []
        for element in node.elts:
            kind, value = _value(element, {}, text, flag)
            kinds.add(kind)
            values.append(value({}))
        return kinds, lambda _: values
    kind, value = _value(node, columns, text, flag)
    if kind != "str":
        raise InvalidValueError(flag, 'values in brackets, such as ("a", "b"), or a text after in', ast.unparse(node))
    return {kind}, value


def _value(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> tuple[str, Condition]:
    """Type and value of a column, a number, a text or a flag."""
    if isinstance(node, ast.Name):
        if node.id not in columns:
            raise UnknownNameError(f"column in {flag}", node.id, columns)
        name = node.id
        return columns[name], lambda row: None if (value := row.get(name)) is None or value != value else value
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        sign = -1 if isinstance(node.op, ast.USub) else 1
        node = node.operand
        if not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
            raise InvalidValueError(flag, GRAMMAR, text)
    if isinstance(node, ast.Constant) and type(node.value) in _LITERALS:
        constant: Any = node.value if isinstance(node.value, (str, bool)) else sign * node.value  # pyright: ignore
        return type(constant).__name__, lambda _: constant
    raise InvalidValueError(flag, GRAMMAR, text)


def _comparable(a: str, b: str) -> bool:
    return a == b or {a, b} <= {"int", "float"}
