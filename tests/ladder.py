"""The rungs of the ladder of equivalence, each as a function that judges one design.

A rung gives "" when the design passes, else one line that tells what it saw. Every rung is bounded:
a dead device is caught like any other. ``python -m tests.ladder`` sends every broken variant up the
ladder and prints what is seen, then which rungs catch which variant, as a Markdown table.
"""

import os
import sys
import textwrap
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from math import sqrt
from unittest.mock import patch

import numpy as np
import z3
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from discreta.hdl.linear import Linear
from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim import compiled as engine
from discreta.sim import survey
from discreta.sim.foreign import UnknownOutputError, available, run_foreign
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.interpreted import PysimModel
from discreta.sim.methods import METHODS
from discreta.sim.proofs import linear as proofs
from discreta.sim.simulate import DeadCoreError, simulate
from discreta.sim.smt import Obligation, Rtl, check, equivalence, extend, symbols
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.broken import ALL, SOUND, VARIANTS, Variant

__all__ = ["RUNGS", "matrix", "missing"]

WIDTH = 4
SEED = 1970

#: Clocks of the golden model after which a bench counts as wrong itself.
_CLOCK_LIMIT = 5000


def documents(variant: Variant) -> str:
    """Judge the steps of every line of a width by exercise 3's program and the closed form."""
    core = variant.device(WIDTH)
    # One behind the other, the line of no length last, behind one that moves.
    blocks = np.roll(survey.survey_lines(WIDTH)[0], -1, axis=0)
    limit = len(blocks) * (2**WIDTH + 4)
    try:
        events = np.concatenate([part.events for part in simulate(core, blocks, limit=limit)])
    except DeadCoreError as error:
        return str(error)
    taken = events[events[:, EVENT_COLUMNS.index("taken")] == 1]
    taken = taken[:, [EVENT_COLUMNS.index("clock"), *range(len(EVENT_COLUMNS), taken.shape[1])]]
    for block in blocks:
        lengths = block[2:] - block[:2]
        line = f"the line {block.tolist()}"
        dx, dy = np.abs(lengths).tolist()
        points = list(_exercise_3(dx, dy, core))
        rows, taken = taken[: len(points)], taken[len(points) :]
        if len(rows) < len(points):
            return f"{line} takes {len(rows)} steps, where the program has {len(points)}"
        moved = (np.cumsum(rows[:, 1:3], axis=0) * np.where(lengths < 0, -1, 1)).tolist()
        for (t, *point), (clock, _, _, last), seen in zip(points, rows, moved, strict=True):
            # The documents know no latency: summations are counted from the first step.
            summation = points[0][0] + int(clock - rows[0, 0])
            if (summation, seen) != (t, point):
                return (
                    f"{line} is at {seen} after {summation} summations, where the program is at "
                    f"{point} after {t}"
                )
            if seen != _closed_form(t, dx, dy, core):
                return f"{line} is at {seen} after {t} summations, against the closed form"
            if last != (t == points[-1][0]):
                return f"{line} has last = {last} at {seen}"
    return f"{len(taken)} steps after the last line" if len(taken) else ""


def _exercise_3(ddx: int, ddy: int, core: Linear) -> Iterator[tuple[int, int, int]]:
    """Run exercise 3's program, and give summations and point whenever it draws one.

    The program itself has 16 bits, sums from 0 and does not normalize, though section II says how.
    """
    modulus = 2**core.width
    kox, koy = ddx, ddy
    while core.normalize and 0 < max(ddx, ddy) < modulus // 2:
        ddx, ddy = 2 * ddx, 2 * ddy
    sx = sy = _initial_sum(core)
    x = y = t = 0
    while kox or koy:
        t += 1
        flag = 0
        if kox:
            carry, sx = divmod(sx + ddx, modulus)
            x, kox, flag = x + carry, kox - carry, flag + carry
        if koy:
            carry, sy = divmod(sy + ddy, modulus)
            y, koy, flag = y + carry, koy - carry, flag + carry
        if flag:
            yield t, x, y


def _closed_form(t: int, dx: int, dy: int, core: Linear) -> list[int]:
    """Give ⌊(S₀ + t·Δ·2^s) / M⌋ of both axes."""
    shift = core.width - max(dx, dy).bit_length() if core.normalize else 0
    return [(_initial_sum(core) + (t * d << shift)) >> core.width for d in (dx, dy)]


def _initial_sum(core: Linear) -> int:
    return 0 if core.preload == "zero" else 2 ** (core.width - 1)


def simulation(variant: Variant) -> str:
    """Compare every register and output at every clock in pysim, without and with stalls."""
    for stalls in (NO_STALLS, Stalls(seed=SEED, stall=0.4, gap=0.3)):
        golden = variant.golden(WIDTH)
        registers, outputs = _golden_run(golden, _blocks(), stalls)
        names = [f"reg_{name}" for name in golden.registers()]
        names += list(golden.outputs(golden.reset()))
        model = PysimModel(variant.device(WIDTH), watch=tuple(names))
        expected = np.hstack([registers, outputs])
        seen = model.run(_blocks(), len(expected), stalls=stalls).watch
        if finding := _difference(seen, expected, names):
            return finding
    return ""


def _blocks() -> np.ndarray:
    """Draw blocks of all kinds: every fourth of no length, some too long to run."""
    random = np.random.default_rng(SEED)
    limit = 2**WIDTH
    starts = random.integers(-limit, limit, (40, 2))
    ends = np.clip(starts + random.integers(-limit, limit, (40, 2)), -limit, limit - 1)
    starts[1], ends[1] = -limit, limit - 1
    ends[::4] = starts[::4]
    return np.hstack([starts, ends])


def _golden_run(
    golden: GoldenLinear, blocks: np.ndarray, stalls: Stalls, resets: tuple[int, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Give registers and outputs at every clock until nothing is left to do."""
    fields = [f"blocks_{which}_{a}" for which in ("start", "end") for a in golden.letters]
    state = golden.reset()
    fed, held = 0, False
    registers, outputs = [], []
    for clock in range(_CLOCK_LIMIT):
        out = golden.outputs(state)
        registers.append(list(state.values()))
        outputs.append(list(out.values()))
        if fed == len(blocks) and not (out["busy"] or out["done"] or out["error"]):
            return np.array(registers), np.array(outputs)
        offers = held or (fed < len(blocks) and stalls.offers(clock))
        inputs = dict(zip(fields, blocks[min(fed, len(blocks) - 1)].tolist(), strict=True))
        inputs |= {"blocks_valid": int(offers), "steps_ready": int(stalls.ready(clock))}
        accepted = offers and out["blocks_ready"] and clock not in resets
        state = golden.reset() if clock in resets else golden.step(state, inputs)
        state = {name: state[name] for name in golden.registers()}
        fed, held = fed + bool(accepted), offers and not accepted
    raise AssertionError(f"the golden model is not done after {_CLOCK_LIMIT} clocks")


def _difference(seen: np.ndarray, expected: np.ndarray, names: list[str]) -> str:
    """Tell the first difference between two records of all clocks."""
    if np.array_equal(seen, expected):
        return ""
    clock, column = np.argwhere(seen != expected)[0]
    return (
        f"{names[column]} is {seen[clock, column]} in clock {clock}, where the golden model has "
        f"{expected[clock, column]}"
    )


def equivalence_by_proof(variant: Variant) -> str:
    """Prove the device equal to the golden model, for all states and inputs."""
    for width in (WIDTH, 2 * WIDTH):
        if finding := _prove(equivalence(variant.device(width), variant.golden(width))):
            return f"width {width}: {finding}"
    return ""


def promises(variant: Variant) -> str:
    """Prove the promises of the device itself, in place of its golden model."""
    core = variant.device(WIDTH)
    rtl = Rtl(core)
    one_clock = [*rtl.transition, rtl.rst == 0]
    return _prove(
        [
            replace(obligation, assumptions=[*one_clock, *obligation.assumptions])
            for obligation in proofs.promises(_as_golden(core, rtl))
            if not obligation.arithmetic  # that is about numbers, whatever the device
        ]
    )


def _as_golden(core: Linear, rtl: Rtl) -> GoldenLinear:
    """Give a device the face of a golden model: its clock is the one clock of ``rtl``."""
    after = {}

    class Device(GoldenLinear):
        def reset(self):
            return {name: register.init for name, register in core.registers.items()}

        def step(self, state, inputs):
            wide = inputs["steps_ready"].size()
            # The transition speaks of these symbols and of no others.
            assert z3.eq(state["running"], symbols(rtl.registers, wide)["running"])
            after.update(symbols(rtl.registers, wide, "'"))
            return after

        def outputs(self, state):
            wide = state["running"].size()
            mark = "'" if after and z3.eq(state["running"], after["running"]) else ""
            return {
                name: extend(z3.BitVec(f"out.{name}{mark}", bits), signed, wide)
                for name, (bits, signed) in rtl.outputs.items()
            }

    return Device(core.width, core.axes, core.normalize, core.preload)


def _prove(obligations: list[Obligation]) -> str:
    """Tell the first thing that does not hold, and the values that break it."""
    for obligation in obligations:
        verdict = check(obligation)
        # A solver that gives up has not caught anything.
        assert "gave up" not in verdict.counterexample, verdict
        if not verdict.holds:
            return f"{verdict.title}: {verdict.counterexample}"
    return ""


def compiled(variant: Variant) -> str:
    """Survey all lines of a width on the compiled engine, each of them from reset."""
    method = replace(
        METHODS["linear"],
        name=variant.name,
        device=lambda width, _, **__: variant.device(width),
        golden=lambda width, _, **__: variant.golden(width),
    )
    blocks, _ = survey.survey_lines(WIDTH)
    # Quick to build rather than to run: the runs are short.
    flags = patch.object(engine, "_FLAGS", (*engine._FLAGS, "-O0"))
    with patch.dict(METHODS, {method.name: method}), flags:
        row = survey._survey_part(method.name, WIDTH, variant.options, blocks)
    findings = list(row.mismatches)
    bound = 1 if variant.options.get("preload") == "zero" else sqrt(0.5)
    if row.largest_error > bound + 1e-9:
        findings.append(f"largest error {row.largest_error:.4f} on the line {row.error_at[:2]}")
    if row.ends_missed:
        findings.append(f"{row.ends_missed} ends missed")
    return "; ".join(findings)


def icarus(variant: Variant) -> str:
    """Compare the outputs of the Verilog in Icarus at every clock, with stalls and resets."""
    return _foreign(variant, "icarus")


def verilator(variant: Variant) -> str:
    """Compare the outputs of the Verilog in Verilator at every clock, with stalls and resets."""
    return _foreign(variant, "verilator")


def _foreign(variant: Variant, simulator: str) -> str:
    stalls = Stalls(seed=SEED + 1, stall=0.4, gap=0.3)
    resets = (60, 150, 151)
    golden, top = variant.golden(WIDTH), PlainPorts(variant.device(WIDTH))
    _, expected = _golden_run(golden, _blocks(), stalls, resets)
    names = list(golden.outputs(golden.reset()))
    text = verilog(top, "line")
    try:
        trace = run_foreign(
            text, "line", top, simulator, _blocks(), len(expected), stalls, resets=resets
        )
    except UnknownOutputError as error:
        return str(error)
    columns = [list(top.outputs).index(name) for name in names]
    return _difference(trace[:, columns], expected, names)


#: The rungs in their order, by their names in the table.
RUNGS: dict[str, Callable[[Variant], str]] = dict(
    zip(
        ALL,
        (documents, simulation, equivalence_by_proof, promises, compiled, icarus, verilator),
        strict=True,
    )
)


def missing(rung: str) -> str:
    """Say why a rung cannot be climbed here; "" when it can."""
    if rung in ("Icarus", "Verilator"):
        return available(rung.lower()) or ""
    if rung == "compiled" and engine.compiler() is None:
        return "no C++ compiler (c++, g++, clang++ or $CXX)"
    return ""


def matrix(caught_by: dict[str, set[str]], left_out: Collection[str] = ()) -> str:
    """Lay out which rungs catch which design, as a Markdown table."""

    def word(rung: str, rungs: set[str]) -> str:
        return "–" if rung in left_out else "caught" if rung in rungs else "passes"

    table = Table(box=MARKDOWN)
    table.add_column("design", no_wrap=True)
    for number, rung in zip((1, 2, 3, 4, 5, 6, 6), RUNGS, strict=True):
        table.add_column(f"{number} {rung}", no_wrap=True)
    for name, rungs in caught_by.items():
        table.add_row(name, *(word(rung, rungs) for rung in RUNGS))
    console = Console(width=200)
    with console.capture() as capture:
        console.print(table)
    return "\n".join(line.strip() for line in capture.get().strip().splitlines())


def _climb(job: tuple[int, str]) -> str:
    index, rung = job
    return RUNGS[rung]([*SOUND, *VARIANTS][index])


def main() -> int:
    """Print what every rung sees of every design, then the matrix; 1 if it is not as expected."""
    out = Console(highlight=False, soft_wrap=True)
    designs = [*SOUND, *VARIANTS]
    rungs = [rung for rung in RUNGS if not missing(rung)]
    for rung in RUNGS:
        if reason := missing(rung):
            out.print(f"{rung} is left out: {reason}", markup=False)
    jobs = list(product(range(len(designs)), rungs))
    caught: dict[str, set[str]] = {design.name: set() for design in designs}
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for (index, rung), finding in zip(jobs, pool.map(_climb, jobs), strict=True):
            if finding:
                name = designs[index].name
                caught[name].add(rung)
                line = textwrap.shorten(finding, 180, placeholder=" …")
                out.print(f"{name}, {rung}: {line}", markup=False)
    out.print(matrix(caught, RUNGS.keys() - rungs), markup=False)
    expected = {design.name: design.caught_by & set(rungs) for design in designs}
    return int(caught != expected)


if __name__ == "__main__":
    sys.exit(main())
