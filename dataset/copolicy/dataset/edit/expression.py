"""Parses conditions on episode columns, such as `duration_s < 20 and source == "human"`, without running Python."""

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
    """Parses a condition into a function of an episode's row.

    Numbers are compared with numbers and texts with texts. `in` tests for one of several values
    (`map_id in ("training-01", "training-02")`) or for a substring (`"slow" in quality_flags`). A boolean column
    needs no comparison (`success and not discarded`). Comparisons with unknown values (null, NaN) are false, except
    `!=` and `not in`.

    Args:
        columns: type of each allowed column: `str`, `int`, `float` or `bool`.

    Raises:
        InvalidValueError: a syntax error, or values of different types compared.
        UnknownNameError: no such column.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
        return _parse_bool(tree.body, columns, text, flag)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InvalidValueError(flag, GRAMMAR, text) from None


def _parse_bool(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> Condition:
    """Parses a boolean part of the expression."""
    if isinstance(node, ast.BoolOp):
        parts = [_parse_bool(value, columns, text, flag) for value in node.values]
        combine = all if isinstance(node.op, ast.And) else any
        return lambda row: combine(part(row) for part in parts)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        inner = _parse_bool(node.operand, columns, text, flag)
        return lambda row: not inner(row)
    if isinstance(node, ast.Compare):
        return _parse_comparison(node, columns, text, flag)
    value_type, value = _parse_value(node, columns, text, flag)
    if value_type != "bool":
        raise InvalidValueError(flag, "a comparison, or a boolean column such as success", ast.unparse(node))
    return lambda row: bool(value(row))


def _parse_comparison(node: ast.Compare, columns: Mapping[str, str], text: str, flag: str) -> Condition:
    parts: list[Condition] = []
    left_node = node.left
    for comparison, right_node in zip(node.ops, node.comparators, strict=True):
        compare = _COMPARISONS.get(type(comparison))
        if compare is None:
            raise InvalidValueError(flag, GRAMMAR, text)
        left_type, left_value = _parse_value(left_node, columns, text, flag)
        if isinstance(comparison, (ast.In, ast.NotIn)):
            right_types, right_value = _parse_membership(right_node, columns, text, flag)
        else:
            right_type, right_value = _parse_value(right_node, columns, text, flag)
            right_types = {right_type}
        if not all(_comparable(left_type, right_type) for right_type in right_types):
            found = f"{left_type} compared with {', '.join(sorted(right_types))} in {ast.unparse(node)}"
            raise InvalidValueError(flag, "values of one type in a comparison", found)
        default = isinstance(comparison, (ast.NotEq, ast.NotIn))
        parts.append(_compare_known(compare, left_value, right_value, default))
        left_node = right_node
    return lambda row: all(part(row) for part in parts)


def _compare_known(compare: Callable[[Any, Any], bool], a: Condition, b: Condition, default: bool) -> Condition:
    def compared(row: Row) -> bool:
        left, right = a(row), b(row)
        return default if left is None or right is None else compare(left, right)

    return compared


def _parse_membership(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> tuple[set[str], Condition]:
    """Parses the right side of `in`: types and function of the values, or of a text to search."""
    if isinstance(node, (ast.Tuple, ast.List, ast.Set)):
        types, values = set(), []
        for element in node.elts:
            value_type, value = _parse_value(element, {}, text, flag)
            types.add(value_type)
            values.append(value({}))
        return types, lambda _: values
    value_type, value = _parse_value(node, columns, text, flag)
    if value_type != "str":
        raise InvalidValueError(flag, 'values in brackets, such as ("a", "b"), or a text after in', ast.unparse(node))
    return {value_type}, value


def _parse_value(node: ast.expr, columns: Mapping[str, str], text: str, flag: str) -> tuple[str, Condition]:
    """Parses a column, number, text or boolean; returns its type and a function of the row."""
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
