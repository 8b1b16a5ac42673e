"""The pysim engine: a design in Amaranth's own simulator, with waveforms of everything inside."""

from contextlib import ExitStack
from typing import IO

import numpy as np
from amaranth.sim import Simulator

from discreta.hdl.contract import Part
from discreta.hdl.plain import PlainPorts
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS, NO_ORDERS, Stretch

__all__ = ["CLOCK_PERIOD", "PysimModel"]

#: Seconds; 100 MHz, so that a clock is 10 ns in a waveform.
CLOCK_PERIOD = 1e-8


class PysimModel:
    """A design in pysim, with the same face as :class:`~discreta.sim.compiled.CompiledModel`.

    Parameters
    ----------
    core : Part
        The interpolator.
    watch : tuple of str
        Ports, or registers prefixed with ``reg_``, to record at every clock.
    vcd : file or None
        Where to write a waveform of every signal of the design. Ended by :meth:`close`.
    """

    def __init__(self, core: Part, *, watch: tuple[str, ...] = (), vcd: IO[str] | None = None):
        self._top = PlainPorts(core)
        self.watch = watch
        self.block_fields = self._top.block_fields
        self.step_fields = self._top.step_fields
        self.control_fields = self._top.control_fields
        signals = self._top.inputs | self._top.outputs
        signals |= {f"reg_{name}": register for name, register in core.registers.items()}
        self._watched = [signals[name] for name in watch]
        self._simulator = Simulator(self._top)
        self._simulator.add_clock(CLOCK_PERIOD)
        self._simulator.add_testbench(self._bench)
        self._clock = 0
        self._offering = self._idle = False
        self._pins: list[int] | None = None
        self._resources = ExitStack()
        if vcd is not None:
            self._resources.enter_context(self._simulator.write_vcd(vcd))

    def close(self) -> None:
        """End the waveform."""
        self._resources.close()

    def run(
        self,
        blocks: np.ndarray,
        clocks: int,
        *,
        until_answered: int = 0,
        stalls: Stalls = NO_STALLS,
        event_room: int = 0,
        orders: np.ndarray = NO_ORDERS,
        until_idle: bool = False,
    ) -> Stretch:
        """Run a stretch of clocks; see :meth:`discreta.sim.compiled.CompiledModel.run`."""
        self._blocks = np.asarray(blocks, dtype=np.int64).tolist()
        self._stalls = stalls
        self._orders = np.asarray(orders, dtype=np.int64).tolist()
        self._fed = self._answered = self._ordered = 0
        self._events: list[list[int]] = []
        self._rows: list[list[int]] = []
        ran = 0
        while ran < clocks and (not event_room or len(self._events) < event_room):
            if until_answered and self._answered >= until_answered:
                break
            before = self._clock
            while self._clock == before:
                self._simulator.advance()
            ran += 1
            if until_idle and self._idle:
                break
        columns = len(EVENT_COLUMNS) + len(self.step_fields)
        events = self._events if event_room else []
        return Stretch(
            ran=ran,
            fed=self._fed,
            answered=self._answered,
            ordered=self._ordered,
            idle=self._idle,
            events=np.array(events, dtype=np.int64).reshape(len(events), columns),
            watch=np.array(self._rows, dtype=np.int64).reshape(len(self._rows), len(self.watch)),
        )

    async def _bench(self, ctx):
        top = self._top
        inputs, outputs = top.inputs, top.outputs
        fields = [inputs[name] for name in self.block_fields]
        step = [outputs[name] for name in self.step_fields]
        controls = [inputs[name] for name in self.control_fields]
        device = "reason" in outputs
        while True:
            while self._ordered < len(self._orders):
                clock, control, value = self._orders[self._ordered]
                if clock > self._clock:
                    break
                ctx.set(controls[control], value)
                self._ordered += 1
            if (
                not self._offering
                and self._fed < len(self._blocks)
                and self._stalls.offers(self._clock)
            ):
                for signal, value in zip(fields, self._blocks[self._fed], strict=True):
                    ctx.set(signal, value)
                self._offering = True
            ready = self._stalls.ready(self._clock)
            ctx.set(inputs["blocks_valid"], self._offering)
            if not device:
                ctx.set(inputs["steps_ready"], ready)

            accepted = self._offering and ctx.get(outputs["blocks_ready"])
            done, error = ctx.get(outputs["done"]), 0
            if device:
                pins = [ctx.get(pin) for pin in step]
                taken = pins != (pins if self._pins is None else self._pins)
                self._pins = pins
            else:
                taken = ready and ctx.get(outputs["steps_valid"])
                error = ctx.get(outputs["error"])
            if accepted or taken or done or error:
                row = [self._clock, int(accepted), done, error, int(taken)]
                self._events.append(row + [ctx.get(signal) for signal in step])
            self._rows.append([ctx.get(signal) for signal in self._watched])
            if accepted:
                self._offering = False
                self._fed += 1
            self._answered += bool(done) + bool(error)
            if device:
                fed = self._fed == len(self._blocks) and not accepted
                self._idle = not ctx.get(outputs["busy"]) and (
                    fed or bool(ctx.get(outputs["reason"]))
                )
            self._clock += 1
            await ctx.tick()
