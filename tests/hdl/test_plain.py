import pytest
from amaranth import signed, unsigned

from discreta.hdl.circular import Circular
from discreta.hdl.linear import Linear
from discreta.hdl.plain import PlainPorts
from tests.hdl.parts.clocked import run

BIT, CODE = unsigned(1), unsigned(2)
# The end of the block drawn below, by axis letter; it starts at the origin.
END = {"x": 5, "y": -3, "z": 1}


def shapes(ports):
    return [(name, port.shape()) for name, port in ports.items()]


async def draw(ctx, top, letters, each_clock=lambda: None):
    """Draw one block and give the moves along each axis and the number of clocks with done."""
    moves, done = dict.fromkeys(letters, 0), 0
    for letter in letters:
        ctx.set(top.inputs[f"blocks_end_{letter}"], END[letter])
    ctx.set(top.steps_ready, 1)
    ctx.set(top.blocks_valid, 1)
    assert ctx.get(top.blocks_ready) == 1
    for _ in range(40):
        each_clock()
        if ctx.get(top.steps_valid):
            for letter in letters:
                moves[letter] += ctx.get(top.outputs[f"steps_{letter}"])
            assert ctx.get(top.steps_last) == (abs(moves["x"]) == abs(END["x"]))
        done += ctx.get(top.done)
        await ctx.tick()
        ctx.set(top.blocks_valid, 0)
    assert ctx.get(top.busy) == 0
    return moves, done


@pytest.mark.parametrize("letters", ["xy", "xyz"])
def test_ports(letters):
    top = PlainPorts(Linear(8, len(letters)))
    coordinate, move = signed(9), signed(2)
    inputs = [
        *((f"blocks_start_{a}", coordinate) for a in letters),
        *((f"blocks_end_{a}", coordinate) for a in letters),
        ("blocks_valid", BIT),
        ("steps_ready", BIT),
    ]
    outputs = [
        ("blocks_ready", BIT),
        *((f"steps_{a}", move) for a in letters),
        ("steps_last", BIT),
        ("steps_valid", BIT),
        *((f"position_{a}", coordinate) for a in letters),
        ("busy", BIT),
        ("done", BIT),
        ("error", CODE),
    ]
    assert shapes(top.inputs) == inputs
    assert shapes(top.outputs) == outputs
    assert [port.name for port in top.inputs.values()] == [name for name, _ in inputs]
    assert [port.name for port in top.outputs.values()] == [name for name, _ in outputs]
    assert top.block_fields == tuple(
        f"blocks_{point}_{a}" for point in ("start", "end") for a in letters
    )
    assert top.step_fields == (*(f"steps_{a}" for a in letters), "steps_last")

    async def bench(ctx):
        moves, done = await draw(ctx, top, letters)
        assert (moves, done) == ({a: END[a] for a in letters}, 1)
        for letter in letters:
            assert ctx.get(top.outputs[f"position_{letter}"]) == END[letter]

    run(top, bench)


def test_ports_of_the_circular():
    core = Circular(8)
    top = PlainPorts(core, observe=core.registers)
    coordinate, move = signed(9), signed(2)
    fields = [
        *((f"{point}_{a}", coordinate) for point in ("start", "end", "center") for a in "xy"),
        ("clockwise", BIT),
        ("full_turns", unsigned(8)),
    ]
    assert shapes(top.inputs) == [
        *((f"blocks_{name}", shape) for name, shape in fields),
        ("blocks_valid", BIT),
        ("steps_ready", BIT),
    ]
    outputs = shapes(top.outputs)
    registers = {name: register.shape() for name, register in top.core.registers.items()}
    assert outputs[:10] == [
        ("blocks_ready", BIT),
        *((f"steps_{a}", move) for a in "xy"),
        ("steps_last", BIT),
        ("steps_valid", BIT),
        *((f"position_{a}", coordinate) for a in "xy"),
        ("busy", BIT),
        ("done", BIT),
        ("error", CODE),
    ]
    assert dict(outputs[10:]) == {f"reg_{name}": shape for name, shape in registers.items()}
    assert len(outputs) == 10 + len(registers)
    assert top.block_fields == tuple(f"blocks_{name}" for name, _ in fields)
    assert top.step_fields == ("steps_x", "steps_y", "steps_last")

    async def bench(ctx):
        # A quarter from the origin around (3, 0), clockwise.
        for name, value in (("end_x", 3), ("end_y", 3), ("center_x", 3), ("clockwise", 1)):
            ctx.set(top.inputs[f"blocks_{name}"], value)
        ctx.set(top.steps_ready, 1)
        ctx.set(top.blocks_valid, 1)
        moves, done = [0, 0], 0
        for _ in range(70):
            if ctx.get(top.steps_valid):
                moves[0] += ctx.get(top.steps_x)
                moves[1] += ctx.get(top.steps_y)
            done += ctx.get(top.done)
            assert ctx.get(top.reg_xt) == ctx.get(top.position_x)
            await ctx.tick()
            ctx.set(top.blocks_valid, 0)
        assert (moves, done) == ([3, 3], 1)
        assert (ctx.get(top.reg_p1), ctx.get(top.reg_p2)) == (0, 3)

    run(top, bench)


@pytest.mark.parametrize(
    ("letters", "own"),
    [
        ("xy", "p1 p2 p3 p4 p5 p6 sx sy"),
        ("xyz", "dx dy dz xt yt zt kox koy koz sx sy sz"),
    ],
)
def test_observe_puts_out_every_register(letters, own):
    core = Linear(8, len(letters))
    top = PlainPorts(core, observe=core.registers)
    per_axis = ("pulse", "direction", "start", "delta", "negative")
    names = {*own.split(), "running", "done", "error", "pending", "fault"}
    names |= {f"{name}_{a}" for name in per_axis for a in letters}
    observed = {name for name in top.outputs if name.startswith("reg_")}
    assert observed == {f"reg_{name}" for name in names}
    assert not any(name.startswith("reg_") for name in top.inputs)
    assert {name: top.outputs[f"reg_{name}"].shape() for name in names} == {
        name: register.shape() for name, register in core.registers.items()
    }

    async def bench(ctx):
        seen = {name: set() for name in names}

        def compare():
            for name in names:
                value = ctx.get(top.outputs[f"reg_{name}"])
                assert value == ctx.get(core.registers[name]), name
                seen[name].add(value)

        await draw(ctx, top, letters, compare)
        position = {2: ("p3", "p4"), 3: ("xt", "yt", "zt")}[len(letters)]
        assert [ctx.get(top.outputs[f"reg_{name}"]) for name in position] == [
            END[a] for a in letters
        ]
        still = {name for name, values in seen.items() if len(values) == 1}
        quiet = {"error", "fault", *(f"start_{a}" for a in letters)}
        forward = {
            f"{name}_{a}" for name in ("direction", "negative") for a in letters if END[a] > 0
        }
        assert still == quiet | forward

    run(top, bench)
