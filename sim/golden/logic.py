"""The little that makes one source run on integers, NumPy arrays and SMT bit-vectors.

A value is a Python int, an integer array, or a signed bit-vector wide enough that no sum in the
model wraps; ``+ - & | ^ << >>`` then mean the same in all three. Conditions are values too: 0 or 1.
"""

import sys
from typing import Any

import numpy as np

__all__ = ["Value", "equal", "less", "negate", "where"]

#: An int, an integer array, or a bit-vector.
Value = Any


def _is_symbolic(*values: Value) -> bool:
    z3 = sys.modules.get("z3")  # symbols exist only where somebody has imported the solver
    return z3 is not None and any(isinstance(value, z3.ExprRef) for value in values)


def _as_bit(condition: Any) -> Value:
    """Turn a comparison's own result into 0 or 1 of the kind that was compared."""
    if isinstance(condition, np.ndarray):
        return condition.astype(np.int64)
    return int(condition)


def equal(a: Value, b: Value) -> Value:
    """1 where a = b, else 0."""
    if _is_symbolic(a, b):
        return _symbolic_bit(a == b, a, b)
    return _as_bit(a == b)


def less(a: Value, b: Value) -> Value:
    """1 where a < b (signed), else 0."""
    if _is_symbolic(a, b):
        return _symbolic_bit(a < b, a, b)
    return _as_bit(a < b)


def where(condition: Value, a: Value, b: Value) -> Value:
    """Give a where the condition is not 0, else b."""
    if _is_symbolic(condition):
        import z3

        return z3.If(condition != 0, *_same_sort(condition, a, b))
    if isinstance(condition, np.ndarray):
        return np.where(condition != 0, a, b)
    return a if condition else b


def negate(bit: Value) -> Value:
    """Negate a condition: 1 − bit."""
    return bit ^ 1


def _symbolic_bit(comparison, a, b):
    import z3

    sort = (a if isinstance(a, z3.ExprRef) else b).sort()
    return z3.If(comparison, z3.BitVecVal(1, sort), z3.BitVecVal(0, sort))


def _same_sort(like, *values):
    import z3

    return [v if isinstance(v, z3.ExprRef) else z3.BitVecVal(v, like.sort()) for v in values]
