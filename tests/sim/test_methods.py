import math

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.sim.carrier import least_periods
from discreta.sim.conics import KINDS, ellipse, random_blocks
from discreta.sim.contour import ArcContour, ConicContour, LineContour
from discreta.sim.methods import METHODS
from discreta.sim.simulate import simulate

LINEAR = METHODS["linear"]


def test_variants_are_all_combinations():
    chosen = {(row["normalize"], row["preload"]) for row in LINEAR.variants()}
    assert chosen == {(n, p) for n in (True, False) for p in ("half", "zero")}
    assert len(LINEAR.variants()) == 4


@pytest.mark.parametrize("axes", [2, 3, 6])
def test_no_point_of_the_fractions_is_farther_than_the_bound(axes):
    """A point is off its line by its fractions, less what lies along the line."""
    random = np.random.default_rng(axes)
    directions = random.random((20_000, axes)) ** 4 + 1e-9
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    corners = random.integers(0, 2, directions.shape)
    for preload, fractions in (("zero", corners), ("half", corners - 0.5)):
        bound = LINEAR.bound(LINEAR.model(8, axes, preload=preload))
        assert bound is not None
        along = np.sum(fractions * directions, axis=1, keepdims=True)
        off = np.linalg.norm(fractions - along * directions, axis=1)
        assert off.max() <= bound
        assert off.max() > 0.9 * bound
    bound = LINEAR.bound(LINEAR.model(8, preload="half"))
    assert bound == pytest.approx(math.sqrt(1 / 2))


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_settings_give_every_choice_a_value_that_is_surveyed(method):
    # What is ours alone has no machine of the documents.
    exact = method.name.startswith("exact_")
    assert method.settings.keys() == {"default", *(() if exact else ("lecture",))}
    for setting in method.settings.values():
        assert setting.keys() == method.choices.keys()
        assert all(value in method.choices[name] for name, value in setting.items())
    # What a device is without a word is the default setting.
    core, model = method.core(8), method.model(8)
    assert core.parameters == core.parameters | method.settings["default"]
    assert all(getattr(model, name) == value for name, value in method.settings["default"].items())
    Fragment.get(core, None)  # else Amaranth complains that it is not used


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_numbers_of_axes(method):
    for axes in method.axes:
        core = method.core(8, axes)
        Fragment.get(core, None)
        assert len(core.position.shape().members) == axes


def blocks_of_lines(count, width):
    """Draw lines, short ones too."""
    random = np.random.default_rng(1)
    start = random.integers(-(2**width), 0, (count, 2))
    length = random.integers(0, 2 ** random.integers(0, width + 1, (count, 1)), (count, 2))
    return np.hstack([start, start + length])


def blocks_of_arcs(count, width):
    """Draw arcs about the origin, small ones too, some of several turns."""
    random = np.random.default_rng(2)
    start = random.integers(0, 2 ** random.integers(1, width, (count, 1)), (count, 2))
    end = np.where(random.random((count, 1)) < 0.5, start[:, ::-1], start)
    end = end * random.choice([-1, 1], (count, 2))
    direction, turns = random.integers(0, 2, count), random.choice([0, 0, 1, 3], count)
    return np.column_stack([start, end, 0 * start, direction, turns])


def blocks_of_conics(count, width):
    """Draw as many of every kind, and circles and turned ellipses of several turns."""
    random = np.random.default_rng(3)
    drawn = [random_blocks(kind, width, count, random) for kind in KINDS]
    around = [
        ellipse((1, -1), axes, 33, width, end_angle=end, full_turns=turns).block
        for axes in ((4, 4), (19, 11), (40, 17))
        for end, turns in ((0, 9), (100, 2))
    ]
    return np.concatenate([*drawn, around])


CONTOURS = {
    "line": lambda blocks: LineContour(blocks, 2),
    "arc": ArcContour,
    "conic": ConicContour,
}
BLOCKS = {
    "line": blocks_of_lines(100, 6),
    "arc": blocks_of_arcs(60, 6),
    "conic": blocks_of_conics(150, 6),
}


def timed_blocks(method, golden, count):
    """Give few and short blocks: a period takes a hundred clocks."""
    blocks = BLOCKS[method.curve][:count].copy()
    if method.curve == "arc":
        blocks[:, 7] = 0
        periods = least_periods(blocks, "plain")
    else:
        periods = 1 + np.abs(blocks[:, 2:] - blocks[:, :2]).max(axis=1) // 5
    return np.column_stack([blocks, periods, np.full(count, golden.least_period + 7)])


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("setting", ["default", "lecture"])
@pytest.mark.parametrize("name", METHODS)
def test_no_block_takes_more_clocks_than_it_may(name, setting):
    """And the limit is no more than a few times too high: a dead core is soon given up."""
    method = METHODS[name]
    if setting not in method.settings:
        pytest.skip(f"{name} has no setting {setting}")
    choices = method.settings[setting]
    golden = method.model(6, **choices)
    blocks = timed_blocks(method, golden, 8) if method.timed else BLOCKS[method.curve]
    most = method.clocks(golden, blocks)
    contour = CONTOURS[method.curve](blocks)
    contour.done_ends = method.timed
    core = method.core(6, **choices)
    # Of a large device so few clocks are sooner run than built.
    engine = "pysim" if method.timed else "compiled"
    for stretch in simulate(core, blocks, limit=int(most.sum()) + 2, engine=engine):
        contour.follow(stretch)
    # Back to back a block begins, at the earliest, with the last step of the one before.
    assert np.all(contour.block_clocks <= most)
    assert contour.block_clocks.sum() > most.sum() / 8
    assert contour.reached.all()


def test_variants_that_make_the_same_machine_are_one():
    """A coefficient is used by rotation alone."""
    method = METHODS["carrier_circular"]
    variants = method.variants()
    assert len(variants) == (2 + 1 + 1) * 2
    for formula, sources in (("rotation", 2), ("predictor_corrector", 1), ("plain", 1)):
        found = {row["coefficient"] for row in variants if row["formula"] == formula}
        assert len(found) == sources
    registers = [
        method.model(8, formula=formula, coefficient=coefficient).registers()
        for formula, coefficient in (
            ("plain", "series"),
            ("plain", "table"),
            ("rotation", "series"),
        )
    ]
    assert registers[0] == registers[1] != registers[2]


@pytest.mark.parametrize("preload", ["half", "zero"])
def test_no_point_of_a_line_on_a_carrier_is_farther_than_the_bound(preload):
    """By its own formula, with mean increments that are up to a whole 2^−f too small."""
    method, width = METHODS["carrier_linear"], 8
    golden = method.model(width, preload=preload)
    bound = method.bound(golden)
    assert bound is not None
    random = np.random.default_rng(6)
    worst = 0.0
    for _ in range(300):
        delta, periods = random.integers(0, 2**width, 2), random.integers(1, 400)
        mean = (delta << golden.fraction_bits) // periods
        passed = np.arange(1, periods)[:, None]
        points = (golden.initial_fraction + passed * mean) >> golden.fraction_bits
        off = np.abs(points[:, 0] * delta[1] - points[:, 1] * delta[0])
        worst = max(worst, np.max(off, initial=0) / max(np.hypot(*delta), 1))
    assert 0.85 * bound < worst <= bound


def test_clocks_of_lines_are_the_power_of_two_above_the_longest_axis():
    lengths = np.array([[0, 0], [1, 0], [5, 3], [8, 7], [255, 1]])
    blocks = np.hstack([np.ones_like(lengths), 1 - lengths])
    normalized = LINEAR.clocks(LINEAR.model(8, normalize=True), blocks)
    assert (normalized - normalized[0]).tolist() == [0, 2, 8, 16, 256]
    plain = LINEAR.clocks(LINEAR.model(8, normalize=False), blocks)
    assert (plain - plain[0]).tolist() == [0, 256, 256, 256, 256]


def test_clocks_of_a_conic_whose_last_axis_hardly_moves():
    """x ends beside the highest point: y' = Gx is then 1, where a step in x changes it by 2^16."""
    method = METHODS["conic"]
    block = [2**15, 0, 2**15, 1 - 2**16 * 700, 0, 1400, 0, 700, 700, 0, 0]
    golden = method.model(12, order="implicit", preload="half", guard=0)
    flat, far = np.array([block]), np.array([[*block[:7], 0, 0, *block[9:]]])
    # A step of y takes 2^16 summations there, and twice as many if they are least in a doubling.
    assert 2**16 < method.clocks(golden, flat)[0] < 2**21
    assert method.clocks(golden, far)[0] < 2**14


def test_clocks_of_conics_whose_scale_does_not_rise():
    """An ellipse has that of its flat side all round, where the gradient is q/p times as large."""
    method, p, q = METHODS["conic"], 3600, 90
    for order, kept in (("implicit", True), ("alternated", True), ("simultaneous", False)):
        golden = method.model(12, order=order, preload="half", guard=0)
        # p²·y² + q²·x² by what leaves whole numbers, from the flat side and from the sharp end.
        flat = [1, 0, 1600, 0, 0, 0, q, 0, q, 0, 40]
        sharp = [1, 0, 1600, 0, 0, p, 0, p, 0, 1, 40]
        clocks = method.clocks(golden, np.array([flat, sharp]))
        # Ten turns in up to 2 summations a step, of 2π·p or, of the faster axis, 4·√(p² + q²).
        steps = 10 * (2 * math.pi * p if kept else 4 * math.hypot(p, q))
        assert np.all(clocks > 2 * steps)
        assert np.all(clocks < 5 * steps)


def test_clocks_of_conics_are_finite_whatever_a_block_is():
    method, width = METHODS["conic"], 24
    random = np.random.default_rng(4)
    five = [random.integers(-(2**bits), 2**bits, 500) for bits in (*[width + 3] * 3, 52, 52)]
    points = random.integers(-(2**width), 2**width, (4, 500))
    blocks = np.stack([*five, *points, *random.integers(0, [[2], [2048]], (2, 500))], axis=1)
    blocks[:10, :5] = 0
    for choices in method.variants():
        clocks = method.clocks(method.model(width, **choices), blocks)
        assert np.all((clocks > 0) & (clocks < 2**55))
