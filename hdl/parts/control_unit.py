"""The control unit (УУ): start, run, wait, end."""

from amaranth import Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import ErrorCode, Part

__all__ = ["ControlUnit"]


class ControlUnit(Part):
    """Starts a block, gives the summators their clock pulses, waits for steps to be taken, ends.

    - ``start`` (старт): the prepared block is taken over in this clock. That needs ``pending``, no
      block running, and no step waiting that is not taken in this very clock. A block with nothing
      to sum, because it is ``empty`` (of no length) or has a ``fault``, waits until no step waits
      at all, so that its answer comes after that of the block before. Nothing is loaded (``load``)
      when it has a fault.
    - ``clock`` (a clock pulse for the summators): a block runs and no step waits, or the one that
      waits is taken in this clock.
    - A block ends with the summation after which no axis has steps left (``ending``). Its last step
      then waits with nothing running: that is how ``last`` is known. ``stepless``, given with
      ``ending``, says that this summation puts out no step.
    - ``done`` (край) is 1 for the one clock after the last step was taken, after the start of an
      empty block, or after a stepless end; ``error`` holds a code for the one clock after the start
      of a block with a fault. Every block that is started is answered by exactly one of the two, in
      order, and never two blocks in one clock.
    - ``idle``: no block runs and no step waits. ``busy``: a block is pending or it is not idle.

    Latency: ``start``, ``load``, ``clock``, ``taken`` and ``last`` in the same clock, ``done`` and
    ``error`` in the next. Throughput: a summation a clock; an empty block or one with a fault takes
    a clock, and one more behind a block that moved. Reset: nothing runs. Overflow, error bound: it
    counts nothing.
    Source: lecture, УУ in the block diagrams; exercise 3, figure 3.3 (the step waits for the pulse
    of the speed-setting block, and the next point is computed when it comes).
    """

    def __init__(self):
        super().__init__(
            {
                "pending": In(1),
                "fault": In(ErrorCode),
                "empty": In(1),
                "waiting": In(1),
                "ready": In(1),
                "ending": In(1),
                "stepless": In(1),
                "start": Out(1),
                "load": Out(1),
                "clock": Out(1),
                "taken": Out(1),
                "last": Out(1),
                "idle": Out(1),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.running = Signal()
        self.done_register = Signal(name="done")
        self.error_register = Signal(ErrorCode, name="error")

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        free = Signal()
        sound = Signal()
        m.d.comb += [
            free.eq(~self.waiting | self.ready),
            sound.eq(self.fault == ErrorCode.NONE),
            self.start.eq(
                self.pending & ~self.running & Mux(self.empty | ~sound, ~self.waiting, free)
            ),
            self.load.eq(self.start & sound),
            self.clock.eq(self.running & free),
            self.taken.eq(self.waiting & self.ready),
            self.last.eq(~self.running),
            self.idle.eq(~self.running & ~self.waiting),
            self.busy.eq(self.pending | ~self.idle),
            self.done.eq(self.done_register),
            self.error.eq(self.error_register),
        ]
        m.d.sync += [
            self.done_register.eq(
                (self.taken & self.last)
                | (self.load & self.empty)
                | (self.clock & self.ending & self.stepless)
            ),
            self.error_register.eq(ErrorCode.NONE),
        ]
        with m.If(self.load):
            m.d.sync += self.running.eq(~self.empty)
        with m.Elif(self.clock & self.ending):
            m.d.sync += self.running.eq(0)
        with m.If(self.start):
            m.d.sync += self.error_register.eq(self.fault)
        return m
