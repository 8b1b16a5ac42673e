import re
from collections import Counter

import pytest

from discreta.hdl.plain import PlainPorts
from discreta.sim import mutants as module
from discreta.sim.foreign import available
from discreta.sim.methods import METHODS
from discreta.sim.mutants import CHECKS, judge, mutants

DEFAULT = METHODS["linear"].settings["default"]


@pytest.fixture(autouse=True)
def _icarus():
    if reason := available("icarus"):
        pytest.skip(reason)


@pytest.mark.parametrize("name", ["exact_line"])
def test_every_mutant_is_caught_or_proven_to_be_none(name):
    seen = []
    verdicts = list(
        judge(
            name, 5, METHODS[name].settings["default"], count=24, progress=lambda *n: seen.append(n)
        )
    )
    assert [verdict.mutant.number for verdict in verdicts] == list(range(1, 25))
    assert seen == [(done, 24) for done in range(25)]
    first = Counter(verdict.caught for verdict in verdicts)
    assert first["outputs"] > 16
    assert set(first) <= {*CHECKS, ""}
    for verdict in verdicts:
        assert verdict.same == (not verdict.caught)
        assert re.match(r"((hdl|amaranth)/\S+:\d+|$)", verdict.mutant.where)


def test_the_proof_catches_what_the_bench_does(monkeypatch):
    """Without the benches it catches the same ones."""
    choices = METHODS["comparison"].settings["default"]
    every = [verdict.same for verdict in judge("comparison", 4, choices, count=12)]
    monkeypatch.setattr(module._Judge, "simulated", lambda *_: False)
    proven = list(judge("comparison", 4, choices, count=12))
    assert {verdict.caught for verdict in proven} <= {"proof", ""}
    assert [verdict.same for verdict in proven] == every


def test_the_same_ones_every_time():
    def made(seed):
        core = METHODS["linear"].core(5, **DEFAULT)
        return mutants(PlainPorts(core, observe=core.registers), 30, seed)

    assert made(1) == made(1)
    assert made(1).mutants != made(2).mutants
    assert len({mutant.what for mutant in made(1).mutants}) == 30


def test_a_core_that_does_not_pass_itself(monkeypatch):
    vectors_of = module.golden_vectors

    def wrong(*arguments):
        vectors = vectors_of(*arguments)
        vectors.outputs["steps_x"][-1] ^= 1
        return vectors

    monkeypatch.setattr(module, "golden_vectors", wrong)
    with pytest.raises(RuntimeError, match="linear itself does not pass: outputs"):
        list(judge("linear", 5, DEFAULT, count=5))


def test_a_solver_that_gives_up_decides_nothing(monkeypatch):
    core = METHODS["linear"].core(5, **DEFAULT)
    made = mutants(PlainPorts(core, observe=core.registers), 5, 1)
    judge_of = module._Judge(core, made.smt, ".")
    assert judge_of.differs(0) is False
    assert judge_of.differs(1) is True
    monkeypatch.setattr(module.z3.Solver, "check", lambda _: module.z3.unknown)
    assert judge_of.differs(1) is None
