import numpy as np
import pytest
import z3

from discreta.sim.golden.logic import equal, less, negate, where

PAIRS = [(-3, 5), (5, -3), (4, 4), (0, 1), (-7, -7)]


def symbolic(value):
    return z3.BitVecVal(value, 8)


@pytest.mark.parametrize(("a", "b"), PAIRS)
@pytest.mark.parametrize(
    ("make", "read"),
    [
        (int, int),
        (lambda value: np.array([value, value]), lambda value: int(value[1])),
        (symbolic, lambda value: z3.simplify(value).as_signed_long()),
    ],
    ids=["int", "numpy", "smt"],
)
def test_the_same_on_integers_arrays_and_bit_vectors(make, read, a, b):
    left, right = make(a), make(b)
    assert read(equal(left, right)) == (1 if a == b else 0)
    assert read(less(left, right)) == (1 if a < b else 0)
    assert read(negate(less(left, right))) == (0 if a < b else 1)
    assert read(where(less(left, right), left, right)) == min(a, b)
    assert read(where(equal(left, right), 1, left)) == (1 if a == b else a)
