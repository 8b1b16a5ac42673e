"""Golden model of a device whose queue holds more than one block: a FIFO before the one that waits.

From the rules of a buffered FIFO: a block that is accepted lies in the store for a clock at least,
and comes to the head when there is none, or when the one there is handed over. Of ``depth`` blocks
one is at the head, the others lie in the store. While the device stands still it is emptied.

The blocks in the store are no registers: it runs on integers alone, for traces and vectors.
"""

from dataclasses import dataclass
from typing import Any

from discreta.sim.golden.device import Device, State

__all__ = ["QueuedDevice"]


@dataclass(frozen=True)
class QueuedDevice:
    """A device with a queue of 2 blocks or more.

    Attributes
    ----------
    device : Device
        The same with a queue of one.
    depth : int
        How many blocks wait at most.
    """

    device: Device
    depth: int

    def __getattr__(self, name: str) -> Any:
        """Have what the device has: ``width``, ``axes``, ``interpolators`` and so on."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.device, name)

    def reset(self) -> State:
        """Give the state after reset: that of the device, and nothing in the store."""
        return self.device.reset() | {"store": ()}

    def outputs(self, state: State) -> dict[str, Any]:
        """Give what the ports show in a state."""
        store = state["store"]
        ready = len(store) < self.depth - 1 and not state["reason"]
        out = self.device.outputs(state)
        return out | {"blocks_ready": int(ready), "busy": out["busy"] | (len(store) > 0)}

    def step(self, state: State, inputs: dict[str, Any]) -> State:
        """Give the state after one clock; ``inputs``: those of the device."""
        store = state["store"]
        after = self.device.step(state, inputs | {"blocks_valid": 0})
        if state["reason"]:
            return after | {"store": ()}
        accepted = inputs["blocks_valid"] and self.outputs(state)["blocks_ready"]
        if store and not after["head"]:
            first, *rest = store
            store = tuple(rest)
            after |= first | {"head": 1}
        if accepted:
            fields = self.device.queue.fields()
            store += ({f"head_{name}": inputs[f"blocks_{name}"] for name in fields},)
        return after | {"store": store}
