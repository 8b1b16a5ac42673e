"""Plain ports with plain names for any interpolator."""

from collections.abc import Mapping

from amaranth import Module, Signal
from amaranth.hdl import ShapeCastable, Value
from amaranth.lib import data, wiring

from discreta.hdl.contract import Part

__all__ = ["PlainPorts", "block_fields", "leaves"]


class PlainPorts(Part):
    """Wraps an interpolator so that every port is a plain vector named by its path.

    ``blocks.payload.start.x`` becomes ``blocks_start_x``, ``steps.valid`` becomes ``steps_valid``.
    This is the face that Verilog users, the compiled engine, the prover and the benches all see.

    Latency, throughput, reset, overflow, error: those of the wrapped interpolator; it is wires
    alone.
    Source: none, it is ours.

    Parameters
    ----------
    core : Part
        The interpolator.
    observe : dict of str to Signal
        Signals inside to put out as well, by name; each name is prefixed with ``reg_``.

    Attributes
    ----------
    inputs, outputs : dict of str to Signal
        The ports, by name, in the order of the interpolator's signature.
    block_fields, step_fields, control_fields : tuple of str
        Those of them that carry a block; that carry a step, or the pins of motor drivers; and
        the inputs beside these streams.
    """

    def __init__(self, core: Part, *, observe: Mapping[str, Signal] | None = None):
        self.core = core
        self._inner: dict[str, Value] = {}
        members: dict[str, wiring.Member] = {}
        for path, member, value in core.signature.flatten(core):
            path = tuple(str(item) for item in path if item != "payload")
            for name, shape, leaf in leaves(path, member.shape, value):
                members[name] = wiring.Member(member.flow, shape)
                self._inner[name] = leaf
        for observed_name, signal in (observe or {}).items():
            name = f"reg_{observed_name}"
            members[name] = wiring.Out(signal.shape())
            self._inner[name] = signal
        super().__init__(members)
        self.inputs: dict[str, Signal] = {}
        self.outputs: dict[str, Signal] = {}
        for name, member in members.items():
            ports = self.inputs if member.flow == wiring.In else self.outputs
            ports[name] = getattr(self, name)
        self.block_fields = _fields("blocks_", self.inputs)
        self.step_fields = _fields("steps_", self.outputs) or _fields("pins_", self.outputs)
        self.control_fields = tuple(
            name for name in self.inputs if not name.startswith(("blocks_", "steps_"))
        )

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.submodules.core = self.core
        m.d.comb += [self._inner[name].eq(port) for name, port in self.inputs.items()]
        m.d.comb += [port.eq(self._inner[name]) for name, port in self.outputs.items()]
        return m


def block_fields(core: Part) -> tuple[str, ...]:
    """Name the plain ports of an interpolator's or a device's blocks."""
    payload = core.blocks.payload
    return tuple(name for name, *_ in leaves(("blocks",), payload.shape(), payload))


def leaves(path, shape, value):
    """Yield (name, shape, value) of every plain vector in ``value``, the name behind a path."""
    if isinstance(shape, data.StructLayout):
        for key, field in shape:
            yield from leaves((*path, key), field.shape, value[key])
    else:
        plain = shape.as_shape() if isinstance(shape, ShapeCastable) else shape
        yield "_".join(path), plain, Value.cast(value)


def _fields(prefix, ports):
    """Name the ports of a stream's payload."""
    handshake = (f"{prefix}valid", f"{prefix}ready")
    return tuple(name for name in ports if name.startswith(prefix) and name not in handshake)
