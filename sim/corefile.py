"""A FuseSoC core file (CAPI2) for a core, so that projects in Verilog depend on it by its name.

The core is ``discreta:interpolators:<method>:<version>``; its target ``default`` has the core, its
targets ``sim`` and ``sim_verilator`` run the test bench in Icarus and in Verilator.

Source: the CAPI2 reference of FuseSoC.
"""

import json
import re
from importlib import metadata

__all__ = ["core_file"]

_CORE = """\
CAPI=2:
name: discreta:interpolators:{method}:{version}
description: {description}

filesets:
  rtl:
    files: [{file}]
    file_type: verilogSource-2005
"""

_BENCH = """\
  bench:
    files: [{bench}]
    file_type: verilogSource-2005
"""

_TARGETS = """\

targets:
  default:
    filesets: [rtl]
    toplevel: {module}
"""

_SIM = """\
  sim: &sim
    description: The self-checking test bench in Icarus
    flow: sim
    flow_options:
      tool: icarus
      iverilog_options: [-g2005]
    filesets: [rtl, bench]
    toplevel: {module}_tb
  sim_verilator:
    <<: *sim
    description: The self-checking test bench in Verilator
    flow_options:
      tool: verilator
      mode: binary
      verilator_options: [--timing, -Wno-fatal]
"""


def core_file(method: str, summary: str, module: str, file: str, bench: str | None = None) -> str:
    """Write the core file of a core.

    Parameters
    ----------
    method, summary : str
        Its name, and what it does in a few words.
    module : str
        Its module; that of the bench is ``<module>_tb``.
    file, bench : str
        The names of the files with the core and the bench, beside the core file; without a bench
        these targets are left out.
    """
    # FuseSoC has versions of numbers alone, with another word behind a dash.
    version = re.sub(r"^(\d+(?:\.\d+)*).*$", r"\1", metadata.version("discreta"))
    text = _CORE + (_BENCH if bench else "") + _TARGETS + (_SIM if bench else "")
    return text.format(
        method=method,
        version=version,
        # JSON strings are YAML, whatever is in them.
        description=json.dumps(summary, ensure_ascii=False),
        file=json.dumps(file, ensure_ascii=False),
        bench=json.dumps(bench, ensure_ascii=False),
        module=module,
    )
