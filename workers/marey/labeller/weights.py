"""The trained weights of the role labeller, and a file to keep them in between two trainings."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from marey.bundles import Bundle
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile
from marey.text.light import LightLabeller, WordStates, light_config
from marey.text.light_network import LightConfig, LightNetwork


@dataclass(frozen=True)
class Weights:
    """A head and its MiniLM."""

    network: LightConfig
    head: dict[str, Tensor]
    updates: dict[str, Tensor]
    """Of MiniLM, as it takes them."""

    def labeller(self, minilm: Bundle) -> LightLabeller:
        """The labeller, before it is in a bundle."""
        network = LightNetwork(self.network)
        network.load_state_dict(self.head)
        return LightLabeller(network, WordStates(minilm, self.network.layers, self.updates), "")

    def save(self, file: Path) -> None:
        """Write the weights to a file."""
        tensors = {f"head/{name}": value for name, value in self.head.items()}
        tensors |= {f"updates/{name}": value for name, value in self.updates.items()}
        save_file(tensors, file, {"network": json.dumps(asdict(self.network))})

    @classmethod
    def load(cls, file: Path) -> Weights:
        """Load a file of `save`.

        Raises:
            InvalidFile: it is another file.
        """
        try:
            with safe_open(file, "pt") as opened:
                network = light_config(parse_json(opened.metadata()["network"], str(file)))
                tensors = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
        except (SafetensorError, OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidFile(f"holds no weights of the labeller: {error}", where=str(file)) from error
        return cls(network, _under("head/", tensors), _under("updates/", tensors))


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
