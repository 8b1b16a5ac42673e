"""Which blocks are surveyed: all there are of a kind, or a seeded sample of them."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np

from discreta.hdl.contract import MIN_WIDTH
from discreta.sim.arcs import RANGE, faster_steps, in_parts, radii, refusals
from discreta.sim.carrier import angles, least_periods, lengths
from discreta.sim.conics import KINDS, ellipse, motion, random_blocks
from discreta.sim.methods import Method

__all__ = ["SAMPLE_BUDGET", "SEED", "WHOLE_BUDGET", "Group", "survey_groups", "whole_degrees"]

SEED = 1970

#: Summations that all blocks of a group may take in the slowest variant; if they would take more, a
#: sample of them is run, which takes so many.
WHOLE_BUDGET, SAMPLE_BUDGET = 1 << 29, 1 << 25

#: A width in whose sample there would be fewer lines, quarter arcs, or curves of 2^width steps, has
#: no survey.
_FEWEST = 64

#: Lines of a sample, arcs of a sample, curves of every kind, and circles or ellipses that are run
#: ten times round.
_LINES, _ARCS, _CURVES, _TEN_TURNS = 1 << 16, 1 << 10, 20_000, 32

#: Arcs of a sample for the exact interpolator, by the width; and their largest radius for 2^width.
_EXACT_ARCS, _EXACT_RADIUS = {12: 2_000_000}, 2800 / 4096

#: Whole turned ellipses for the exact interpolator.
_WHOLE_ELLIPSES = 512

#: On a carrier: steps per period from and to, along the longer axis of a line and along an arc, and
#: clocks of a period more than those that every variant needs.
_PERIOD_STEPS, _PERIOD_CLOCKS = {"line": (0.3, 20), "arc": (2, 20)}, 64

#: Blocks of a group whose timing no device takes.
_BADLY_TIMED = 64

#: Radii of the arcs between whole degrees, in steps; of those all round every so manieth is run.
_RADII, _STRIDE = range(2, 200, 3), 1999


@dataclass(frozen=True)
class Group:
    """Blocks that are surveyed together.

    Attributes
    ----------
    title : str
        How many of what: ``"all 255 quarter arcs"``.
    blocks : array of int64, shape (blocks, block fields)
    answers : array of int64, shape (blocks,)
        What each must be answered: 0 for ``done``, else the code of ``error``.
    lengths : array of float, shape (blocks,)
        Steps of the axis that moves faster: of a line the longer one, of an arc in every octant the
        one of the smaller coordinate, of any curve the one whose derivative is the smaller. 0 for a
        block that is refused.
    """

    title: str
    blocks: np.ndarray
    answers: np.ndarray
    lengths: np.ndarray


def survey_groups(method: Method, width: int) -> list[Group]:
    """Choose the groups of a survey.

    Lines: of every pair of lengths there is, quadrant and start point drawn from the seed. Arcs:
    counter-clockwise about the origin all quarter arcs from (R, 0) to (0, R), all circles from (R,
    0) and ten turns of some of them, evenly spread; and a sample of arcs of any radius, center,
    start, end and direction. Conics: 20,000 random curves of every kind, and ten turns of ellipses
    about the origin of any axis ratio and angle, of which the exact interpolator runs 512 once
    round, too. A group that would take more than :data:`WHOLE_BUDGET` summations is a sample that
    takes up to :data:`SAMPLE_BUDGET`.

    The exact interpolator of arcs runs all quarter arcs and circles, and a sample of 65,536 arcs,
    of 12 bits 2,000,000, of radii up to 0.68 times 2^width, the largest that have room anywhere;
    none that the device cannot know to be off the circle or out of the coordinates.

    On a carrier lines, quarter arcs, circles and arcs alike, but no ten turns, as many as take
    :data:`SAMPLE_BUDGET` clocks, their timing drawn from the seed; and behind some of them the same
    block with a timing that must be refused.

    Raises
    ------
    ValueError
        A single block of this width takes too many clocks.
    """
    if method.timed:
        return _timed_groups(method, width)
    if method.exact and method.curve == "arc":
        return _exact_arc_groups(width)
    if method.curve == "line":
        return _line_groups(width)
    return {"arc": _arc_groups, "conic": _conic_groups}[method.curve](method, width)


def _room(width: int, name: str, summations: Callable[[int], int]) -> int:
    """Give how many blocks that take so many summations a sample has room for."""

    def room(width: int) -> int:
        return SAMPLE_BUDGET // summations(width)

    if room(width) < _FEWEST:
        largest = max(w for w in range(MIN_WIDTH, width) if room(w) >= _FEWEST)
        raise ValueError(
            f"width {width} is too large to survey: one {name} takes up to {summations(width)} "
            f"clocks; choose a width up to {largest}"
        )
    return room(width)


def _room_for_quarters(method: Method, width: int) -> int:
    """Give how many quarter arcs a sample has room for."""
    guard = max(method.choices["guard"])
    return _room(width, "quarter arc", lambda width: ceil(pi / 2 * 2 ** (width + guard)))


def _how_many(chosen: int, count: int, what: str) -> str:
    return f"{'all' if chosen == count else f'a sample (seed {SEED}) of'} {chosen} {what}"


def _line_groups(width: int) -> list[Group]:
    modulus = 1 << width
    room = _room(width, "line", lambda width: 1 << width)
    random = np.random.default_rng(SEED)
    if modulus**3 <= WHOLE_BUDGET:
        lengths = np.stack(np.divmod(np.arange(modulus**2), modulus), axis=1)
    else:
        lengths = random.integers(0, modulus, (min(_LINES, room), 2))
    signs = random.choice((-1, 1), lengths.shape)
    low = np.where(signs < 0, lengths, 0) - modulus
    high = np.where(signs > 0, -lengths, 0) + modulus - 1
    starts = random.integers(low, high, endpoint=True)
    blocks = np.concatenate([starts, starts + signs * lengths], axis=1)
    # The line of no length last, behind one that moves.
    blocks, lengths = np.roll(blocks, -1, axis=0), np.roll(lengths, -1, axis=0)
    return [
        Group(
            _how_many(len(blocks), modulus**2, "lines"),
            blocks,
            np.zeros(len(blocks), dtype=np.int64),
            lengths.max(axis=1).astype(float),
        )
    ]


def _arc_groups(method: Method, width: int) -> list[Group]:
    room = _room_for_quarters(method, width)
    top = (1 << width) - 1
    quarters = _pick(np.arange(1, top + 1), room)
    # A circle's axes may rise to R + 1.
    circles = _pick(np.arange(1, top), room // 4)
    spread = np.linspace(1, top - 1, min(_TEN_TURNS, room // 40, top - 1)).round()
    arcs = _random_arcs(width, min(_ARCS, room // 2))
    return [
        _arc_group(title, blocks, width)
        for title, blocks in (
            (_how_many(len(quarters), top, "quarter arcs"), _about_origin(quarters, quarter=True)),
            (_how_many(len(circles), top - 1, "circles"), _about_origin(circles)),
            (f"ten turns of {len(spread)} circles", _about_origin(spread, full_turns=9)),
            (f"a sample (seed {SEED}) of {len(arcs)} arcs", arcs),
        )
    ]


def _exact_arc_groups(width: int) -> list[Group]:
    top = (1 << width) - 1
    # A circle takes 4·√2 steps for every step of its radius.
    room = _room(width, "circle", lambda width: ceil(4 * sqrt(2) * 2**width))
    circles = _pick(np.arange(1, top + 1), room)
    spread = np.linspace(1, top, min(_TEN_TURNS, room // 10)).round()
    count = min(_EXACT_ARCS.get(width, 1 << 16), 8 * room if width > 12 else 1 << 21)
    random = np.random.default_rng(SEED)
    radius = random.uniform(1, _EXACT_RADIUS * (1 << width), count)
    low, high = np.ceil(radius) + 1 - (1 << width), (1 << width) - 2 - np.ceil(radius)
    arcs = np.zeros((count, 8), dtype=np.int64)
    for column in (0, 2):
        angle = random.uniform(0, 2 * pi, count)
        points = np.rint(radius * [np.cos(angle), np.sin(angle)]).T
        arcs[:, column : column + 2] = points
        # The end is rounded to whole steps from the circle of the rounded start.
        radius = np.hypot(*points.T)
    center = np.floor(random.uniform(low, high, (2, count))).astype(np.int64).T
    arcs[:, 4:6] = center
    arcs[:, :4] += np.tile(center, 2)
    arcs[:, 6] = random.integers(0, 2, count)
    return [
        Group(title, blocks, np.zeros(len(blocks), dtype=np.int64), in_parts(faster_steps, blocks))
        for title, blocks in (
            (_how_many(len(circles), top, "quarter arcs"), _about_origin(circles, quarter=True)),
            (_how_many(len(circles), top, "circles"), _about_origin(circles)),
            (f"ten turns of {len(spread)} circles", _about_origin(spread, full_turns=9)),
            (f"a sample (seed {SEED}) of {count} arcs", arcs),
        )
    ]


def _timed_groups(method: Method, width: int) -> list[Group]:
    models = [method.model(width, 2, **variant) for variant in method.variants()]
    least = max(model.least_period for model in models)
    fewest = _PERIOD_STEPS[method.curve][0]
    name, far = ("line", 1) if method.curve == "line" else ("quarter arc", pi / 2)

    def most_clocks(width: int) -> int:
        return ceil(far * 2**width / fewest) * (least + _PERIOD_CLOCKS)

    _room(width, name, most_clocks)
    if method.curve == "line":
        (group,) = _line_groups(width)
        chosen = [("lines", 4**width, group.blocks)]
    else:
        radii = np.arange(1, 1 << width)
        arcs = _random_arcs(width, _ARCS)
        chosen = [
            ("quarter arcs", len(radii), _about_origin(radii, quarter=True)),
            # A circle's axes may rise to R + 1.
            ("circles", len(radii) - 1, _about_origin(radii[:-1])),
            ("arcs", 0, arcs),
        ]
    random = np.random.default_rng(SEED)
    return [_timed_group(*group, method.curve, least, random) for group in chosen]


def _timed_group(
    what: str,
    there_are: int,
    blocks: np.ndarray,
    kind: str,
    least: int,
    random: np.random.Generator,
) -> Group:
    """Time as many of the blocks, of so many that there are, as there is room for."""
    if kind == "line":
        far = np.abs(blocks[:, 2:] - blocks[:, :2]).max(axis=1).astype(float)
        enough = np.ones(len(blocks), dtype=np.int64)
    else:
        far, enough = lengths("arc", blocks), least_periods(blocks, "plain")
    low, high = _PERIOD_STEPS[kind]
    steps = np.exp(random.uniform(np.log(low), np.log(high), len(blocks)))
    periods = np.maximum(np.ceil(far / steps).astype(np.int64), enough)
    period = random.integers(least, least + _PERIOD_CLOCKS, len(blocks), endpoint=True)
    blocks = np.column_stack([blocks, periods, period])
    order = random.permutation(len(blocks))
    room = np.searchsorted(np.cumsum((periods * period)[order]), SAMPLE_BUDGET, side="right")
    chosen = np.sort(order[:room])
    blocks, far = blocks[chosen], far[chosen]

    title = _how_many(len(blocks), there_are, what)
    behind = np.sort(random.integers(0, len(blocks), _BADLY_TIMED))
    bad = blocks[behind]
    # No periods; a period too short; and an angle too large, or again too short.
    bad[0::3, -2], bad[1::3, -1] = 0, 1
    if kind == "line":
        bad[2::3, -1] = 0
    else:
        bad[2::3, -2] = angles(bad[2::3]) > 1
        far = faster_steps(blocks)
    return Group(
        f"{title}, and {len(bad)} of bad timing",
        np.insert(blocks, behind + 1, bad, axis=0),
        np.insert(np.zeros(len(blocks), dtype=np.int64), behind + 1, RANGE),
        np.insert(far, behind + 1, 0.0),
    )


def _pick(candidates: np.ndarray, room: int) -> np.ndarray:
    """Choose all, or where they would take too long a sample with this room, in their order."""
    if len(candidates) <= room * (WHOLE_BUDGET // SAMPLE_BUDGET):
        return candidates
    return np.sort(np.random.default_rng(SEED).choice(candidates, room, replace=False))


def _arc_group(title: str, blocks: np.ndarray, width: int) -> Group:
    answers = refusals(blocks, width)
    return Group(title, blocks, answers, np.where(answers == 0, faster_steps(blocks), 0.0))


def _about_origin(radii: np.ndarray, *, quarter: bool = False, full_turns: int = 0) -> np.ndarray:
    """Give quarter arcs or circles of these radii about the origin, counter-clockwise."""
    blocks = np.zeros((len(radii), 8), dtype=np.int64)
    blocks[:, 0] = radii
    blocks[:, 3 if quarter else 2] = radii
    blocks[:, 7] = full_turns
    return blocks


def _random_arcs(width: int, count: int) -> np.ndarray:
    """Draw arcs that are not refused, ends nearest to the circle of the start."""
    modulus = 1 << width
    random = np.random.default_rng(SEED)
    chosen = np.empty((0, 8), dtype=np.int64)
    while len(chosen) < count:
        angles = random.uniform(0, 2 * pi, (2, 2 * count))
        radius = random.uniform(1, modulus, 2 * count)
        center = random.integers(-modulus, modulus, (2 * count, 2))
        blocks = np.zeros((2 * count, 8), dtype=np.int64)
        for column, angle in zip((0, 2), angles, strict=True):
            point = np.rint(radius * [np.cos(angle), np.sin(angle)]).T
            blocks[:, column : column + 2] = center + point
            radius = np.hypot(*point.T)
        blocks[:, 4:6] = center
        blocks[:, 6] = random.integers(0, 2, 2 * count)
        inside = np.all((blocks[:, :4] >= -modulus) & (blocks[:, :4] < modulus), axis=1)
        inside[inside] = refusals(blocks[inside], width) == 0
        chosen = np.concatenate([chosen, blocks[inside]])
    return chosen[:count]


def _conic_groups(method: Method, width: int) -> list[Group]:
    guard = max(method.choices.get("guard", (0,)))
    # A summation moves the faster axis by half of 2^−guard at least.
    _room(width, f"curve of {1 << width} steps", lambda width: 2 << (width + guard))
    groups = []
    for kind in KINDS:
        blocks = random_blocks(kind, width, _CURVES, np.random.default_rng(SEED))
        lengths, summations = _work_of_conics(blocks, guard)
        if summations.sum() > WHOLE_BUDGET:
            count = np.searchsorted(np.cumsum(summations), SAMPLE_BUDGET)
            blocks, lengths = blocks[:count], lengths[:count]
        title = f"a sample (seed {SEED}) of {len(blocks)} {kind}s"
        groups.append(Group(title, blocks, np.zeros(len(blocks), dtype=np.int64), lengths))
    whole = [("whole", _WHOLE_ELLIPSES, 0)] if method.exact else []
    for what, most, full_turns in (*whole, ("ten turns of", _TEN_TURNS, 9)):
        blocks = _random_ellipses(width, most, full_turns=full_turns)
        lengths, summations = _work_of_conics(blocks, guard)
        count = np.searchsorted(np.cumsum(summations), SAMPLE_BUDGET)
        answers = np.zeros(count, dtype=np.int64)
        title = f"{what} {count} ellipses" if full_turns else f"{count} {what} turned ellipses"
        groups.append(Group(title, blocks[:count], answers, lengths[:count]))
    return groups


def _work_of_conics(blocks: np.ndarray, guard: int) -> tuple[np.ndarray, np.ndarray]:
    """Give the steps of the axis that moves faster, and the most summations that they may take."""
    course = motion(blocks)
    return course.steps, (2 << guard) * np.fmax(course.steps, course.time * course.largest)


def _random_ellipses(width: int, count: int, *, full_turns: int) -> np.ndarray:
    """Draw ellipses about the origin, from circles to those that bend within three steps."""
    random = np.random.default_rng(SEED)
    blocks = []
    for _ in range(count):
        longer = ((1 << width) - 3) * random.uniform(0.3, 1)
        narrowest = min(1, sqrt(3 / longer))
        drawn = ellipse(
            (0, 0),
            (longer, longer * narrowest ** random.random()),
            random.uniform(0, 180),
            width,
            # Where it is flattest.
            start_angle=90,
            end_angle=90,
            clockwise=bool(random.integers(2)),
            full_turns=full_turns,
        )
        blocks.append(drawn.block)
    return np.array(blocks, dtype=np.int64)


def whole_degrees(method: Method, width: int) -> list[Group]:
    """Choose the arcs between the lattice points nearest to whole degrees of 66 circles.

    The radii are 2, 5, … 197 steps, the center is the origin; halves are rounded outwards. In
    quadrant I all pairs of degrees, 0 to 90, with two points; the same arcs turned and mirrored,
    each to the next of its seven images; and of the arcs from every degree by 1 to 360 degrees in
    both directions every 1999th. An end may be more than one step off the circle of the start: then
    it must be refused.

    Raises
    ------
    ValueError
        The method draws no arcs, the width has no room for the circles, or takes too many clocks.
    """
    if method.timed:
        raise ValueError(f"{method.name} has no arcs between whole degrees: survey circular")
    if method.curve != "arc":
        raise ValueError(f"there are no {method.curve}s between whole degrees: survey circular")
    if method.exact:
        # It does not know which ends are too far off the circle.
        raise ValueError(f"{method.name} has no arcs between whole degrees: survey circular")
    far = _RADII[-1] + 1
    if far >= 1 << width:
        raise ValueError(
            f"the arcs between whole degrees go up to {far} steps from their center: width {width} "
            f"has room for {(1 << width) - 1}; choose a width from {far.bit_length()}"
        )
    room = _room_for_quarters(method, width)
    points = _degree_points()
    first = _first_quadrant(points)
    groups = []
    for what, blocks in (
        ("arcs in quadrant I, counter-clockwise", first),
        ("of these arcs, turned to all quadrants and directions", _turned(first)),
        (f"arcs all round, every {_STRIDE}th there is", _all_round(points)),
    ):
        group = _arc_group("", blocks, width)
        right_angles = group.lengths / (sqrt(2) * radii(blocks))
        chosen = _pick(np.arange(len(blocks)), int(room / right_angles.mean()))
        title = _how_many(len(chosen), len(blocks), what)
        groups.append(Group(title, blocks[chosen], group.answers[chosen], group.lengths[chosen]))
    return groups


def _degree_points() -> np.ndarray:
    """Give the lattice points nearest to whole degrees, shape (radii, 360, 2)."""
    angles = np.radians(np.arange(90))
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # R·cos 60° is half a step for every odd R, or a little less by the rounding of the cosine.
    points = np.floor(np.array(_RADII)[:, None, None] * circle + (0.5 + 1e-9)).astype(np.int64)
    quadrants = [points]
    for _ in range(3):
        quadrants.append(quadrants[-1][..., ::-1] * [-1, 1])
    return np.concatenate(quadrants, axis=1)


def _first_quadrant(points: np.ndarray) -> np.ndarray:
    begin, end = np.triu_indices(91, 1)
    blocks = np.zeros((len(points), len(begin), 8), dtype=np.int64)
    blocks[..., 0:2], blocks[..., 2:4] = points[:, begin], points[:, end]
    return blocks[np.any(blocks[..., 0:2] != blocks[..., 2:4], axis=-1)]


def _turned(blocks: np.ndarray) -> np.ndarray:
    """Turn and mirror arcs about the origin, each to the next of the seven images that it has."""
    image = 1 + np.arange(len(blocks)) % 7
    turned = blocks.copy()
    turned[:, 6] = image // 4
    turned[:, 1:4:2] *= np.where(image < 4, 1, -1)[:, None]
    for _ in range(3):
        image, turn = np.where(image % 4, image - 1, image), image % 4 > 0
        for x in (0, 2):
            turned[turn, x : x + 2] = turned[turn, x : x + 2][:, ::-1] * [-1, 1]
    return turned


def _all_round(points: np.ndarray) -> np.ndarray:
    shape = (len(points), 360, 360, 2)
    radius, begin, sweep, clockwise = np.unravel_index(np.arange(0, np.prod(shape), _STRIDE), shape)
    end = begin + (1 + sweep) * np.where(clockwise, -1, 1)
    blocks = np.zeros((len(radius), 8), dtype=np.int64)
    blocks[:, 0:2], blocks[:, 2:4] = points[radius, begin], points[radius, end % 360]
    blocks[:, 6] = clockwise
    return blocks[(sweep == 359) | np.any(blocks[:, 0:2] != blocks[:, 2:4], axis=1)]
