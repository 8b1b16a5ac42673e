"""Golden model of the comparison line, one clock at a time.

From the article (linear interpolation, part one): its routine, its table from (5, 2) to (35, 20)
and its form with a single summator. Blocks, steps and УУ are those of every line interpolator; see
:mod:`discreta.sim.golden.line_frame`, which names the registers too. To these come the article's
accumulators SX and SY, or their difference S alone.
"""

from dataclasses import dataclass

from discreta.sim.golden.line_frame import LineFrame, State
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["Comparison"]


@dataclass(frozen=True)
class Comparison(LineFrame):
    """The comparison line of n = ``width`` bits.

    Attributes
    ----------
    width : int
        n, 4 to 32.
    form : str
        ``"two"``: SX and SY, which reach ΔX·ΔY; ``"signed"``: their difference S.
    first : str
        The axis that steps first at 45°: ``"x"`` or ``"y"``.
    """

    width: int = 16
    form: str = "signed"
    first: str = "x"

    def sums(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every summator and whether it is signed."""
        if self.form == "two":
            return dict.fromkeys(("sx", "sy"), (2 * self.width, False))
        return {"s": (self.width + 1, True)}

    def summed(self, state: State, clock: Value) -> tuple[State, State]:
        """Give the steps that a summation puts out, by axis letter, and every summator after it.

        The article: the smaller accumulator is added to and its coordinate moves; the longer axis
        goes first, and at 45° the one that was chosen.
        """
        dx, dy = state["p1"], state["p2"]
        x_longer, y_longer = less(dy, dx), less(dx, dy)
        x_leads = x_longer if self.first == "y" else negate(y_longer)
        if self.form == "two":
            sx, sy = state["sx"], state["sy"]
            x_turn = less(sx, sy) | (equal(sx, sy) & x_leads)
        else:
            x_turn = less(state["s"], 0) | (equal(state["s"], 0) & x_leads)
        steps = {"x": clock & x_turn, "y": clock & negate(x_turn)}
        x_adds, y_adds = where(steps["x"], dy, 0), where(steps["y"], dx, 0)
        if self.form == "two":
            mask = 2 ** (2 * self.width) - 1
            sums = {"sx": (state["sx"] + x_adds) & mask, "sy": (state["sy"] + y_adds) & mask}
        else:
            sums = {"s": self._wrap(state["s"] + x_adds - y_adds)}
        return steps, sums
