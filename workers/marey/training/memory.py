"""Memory of training, by counting the tensors that autograd saves for the backward pass.

A network of equal layers saves a + c·L + b·(d + e·L) bytes for L layers and b samples of the longest length: four
counts of small L and b give a to e, and with them the sum at any size. Measured networks are as wide as the real ones;
only layers and samples are few.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from marey.core.errors import InvalidInput
from marey.nn.transformer import like_a_gpu
from marey.training.optimisation import StageConfig

GIB = 2**30
ROOM = 0.92
"""Share of a device's memory that is planned for; the rest is for its context and fragments."""
WORKING = 2
"""Working memory of the backward pass, in largest saved tensors of a part."""
AGAIN, AGAIN_BF16 = 0.2, 0.55
"""The same while a layer is computed again, in what it saves: with matrices in bfloat16 half of the work is still done
in float32."""
BF16 = "bfloat16"


@dataclass(frozen=True)
class SavedBytes:
    """Bytes that a forward pass keeps for the backward pass.

    Attributes:
        by_dtype: of all tensors, those of equal storage once; weights and buffers are left out.
        largest: of the largest tensor that is no weight in another number type.
    """

    by_dtype: Mapping[str, int]
    largest: int

    @property
    def total(self) -> int:
        """Return the sum."""
        return sum(self.by_dtype.values())


def count_saved(forward: Callable[[], object], module: nn.Module) -> SavedBytes:
    """Run a forward pass, and count what it saves (`torch.autograd.graph.saved_tensors_hooks`)."""
    own = {tensor.untyped_storage().data_ptr() for tensor in (*module.parameters(), *module.buffers())}
    weights = {tuple(sorted(tensor.shape)) for tensor in module.parameters()}
    kept: dict[int, Tensor] = {}  # they are held, so that no place is used twice

    def pack(tensor: Tensor) -> Tensor:
        place = tensor.untyped_storage().data_ptr()
        if place not in own:
            kept.setdefault(place, tensor)
        return tensor

    with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
        result = forward()
    sizes = Counter[str]()
    for tensor in kept.values():
        sizes[str(tensor.dtype).removeprefix("torch.")] += tensor.untyped_storage().nbytes()
    del result
    made = (tensor for tensor in kept.values() if tuple(sorted(tensor.shape)) not in weights)
    return SavedBytes(sizes, max((tensor.untyped_storage().nbytes() for tensor in made), default=0))


@dataclass(frozen=True)
class Amount:
    """Bytes that grow with layers and samples: `fixed` + `layer`·L + b·(`sample` + `both`·L)."""

    fixed: float
    layer: float
    sample: float
    both: float

    @classmethod
    def of(cls, count: Callable[[int, int], float]) -> Amount:
        """Fit four counts of (layers, samples), at one and two of each."""
        one, deep, wide, all_two = count(1, 1), count(2, 1), count(1, 2), count(2, 2)
        both = all_two - deep - wide + one
        layer, sample = deep - one - both, wide - one - both
        return cls(one - layer - sample - both, layer, sample, both)

    def at(self, layers: int, samples: int) -> float:
        """Return the bytes of so many layers and samples."""
        return self.fixed + self.layer * layers + samples * (self.sample + self.both * layers)


@dataclass(frozen=True)
class MemoryEstimate:
    """A sum of bytes, part by part, for `samples` in one pass."""

    samples: int
    recompute: bool
    parts: Mapping[str, float]

    @property
    def total(self) -> float:
        """Return the sum."""
        return sum(self.parts.values())

    def rows(self) -> Iterator[tuple[str, str]]:
        """Yield the parts and the sum, in GiB."""
        for name, size in (*self.parts.items(), ("sum", self.total)):
            yield name, f"{size / GIB:.2f} GiB"


@dataclass(frozen=True)
class MemoryModel:
    """Memory of one stage at any number of samples a pass.

    Attributes:
        stage: its name.
        batch: samples of a step.
        layers: L.
        weights: bytes of weights and buffers.
        trained: bytes of the weights that are trained, as many again as gradients and twice as many in AdamW.
        average: bytes of their moving average, 0 without one.
        saved: what the forward pass saves, by number type.
        largest: bytes of the largest saved tensor of one sample.
        carried: bytes between two layers, of one sample; all that is kept of a layer that is computed again. None
            where layers cannot be computed again.
    """

    stage: str
    batch: int
    layers: int
    weights: int
    trained: int
    average: int
    saved: Mapping[str, Amount]
    largest: float
    carried: float | None = None

    @classmethod
    def counted(
        cls,
        stage: str,
        optimisation: StageConfig,
        module: nn.Module,
        count: Callable[[int, int], SavedBytes],
        *,
        layers: int,
        carried: float | None = None,
        batch: int | None = None,
    ) -> MemoryModel:
        """Count what a stage saves, and add up its weights.

        Args:
            stage: its name.
            optimisation: of the stage.
            module: all its networks; may be on the device `meta`.
            count: what is saved by (layers, samples), at one and two of each.
            layers: L.
            carried: see the class.
            batch: samples of a step, if they are not those of `optimisation`.
        """
        found = {(deep, many): count(deep, many) for deep in (1, 2) for many in (1, 2)}
        names = sorted({name for each in found.values() for name in each.by_dtype})
        trained = sum(_bytes(each) for each in module.parameters() if each.requires_grad)
        return cls(
            stage=stage,
            batch=batch or optimisation.batch,
            layers=layers,
            weights=sum(_bytes(each) for each in (*module.parameters(), *module.buffers())),
            trained=trained,
            average=trained if optimisation.ema else 0,
            saved={
                name: Amount.of(lambda deep, many, name=name: found[deep, many].by_dtype.get(name, 0)) for name in names
            },
            largest=found[1, 2].largest - found[1, 1].largest,
            carried=carried,
        )

    def estimate(self, samples: int, *, recompute: bool = False) -> MemoryEstimate:
        """Estimate the largest use of memory with so many samples a pass.

        Args:
            samples: of a forward and backward pass.
            recompute: layers are computed again in the backward pass.

        Raises:
            InvalidInput: they cannot be.
        """
        if recompute and self.carried is None:
            raise InvalidInput(f"{self.stage} cannot compute layers again", where="--recompute")
        parts: dict[str, float] = {"weights": self.weights, "gradients": self.trained, "AdamW": 2 * self.trained}
        if self.average:
            parts["average of the weights"] = self.average
        working = WORKING * samples * self.largest
        if not recompute or self.carried is None:
            for name, amount in self.saved.items():
                parts[f"saved for the backward pass, {name}"] = amount.at(self.layers, samples)
            return MemoryEstimate(samples, recompute, {**parts, "working memory": working})
        parts["inputs of the layers"] = samples * self.layers * self.carried
        head = working + sum(amount.at(0, samples) for amount in self.saved.values())
        again = AGAIN
        if BF16 in self.saved:  # autocast keeps its copies of all weights until the forward pass ends
            head, again = head + self.layers * self.saved[BF16].layer, AGAIN_BF16
        layer = (1 + again) * sum(amount.layer + samples * amount.both for amount in self.saved.values())
        parts["one layer, computed again" if layer > head else "behind the layers"] = max(head, layer)
        return MemoryEstimate(samples, recompute, parts)

    def fit(self, memory: float, *, recompute: bool = False) -> MemoryEstimate:
        """Return the estimate with the most samples a pass, at most a batch, that fits so many bytes.

        Raises:
            InvalidInput: not even one sample fits, or layers cannot be computed again.
        """
        fitting: Iterable[MemoryEstimate] = (
            found
            for samples in range(self.batch, 0, -1)
            if (found := self.estimate(samples, recompute=recompute)).total <= ROOM * memory
        )
        found = next(iter(fitting), None)
        if found is None:
            least = self.estimate(1, recompute=recompute).total / GIB
            raise InvalidInput(
                f"{self.stage} needs {least:.1f} GiB for one sample; there are {memory / GIB:.1f}",
                where="--micro-batch",
                hint=self._hint(recompute),
            )
        return found

    def _hint(self, recompute: bool) -> str:
        again = "give --recompute, or " if self.carried is not None and not recompute else ""
        return f"{again}choose a smaller configuration.".capitalize()


def _bytes(tensor: Tensor) -> int:
    return tensor.numel() * tensor.element_size()


def device_memory(device: torch.device) -> int:
    """Return the bytes of a device: of the GPU, or of the machine.

    Raises:
        InvalidInput: it does not say.
    """
    if device.type == "cuda":
        return torch.cuda.get_device_properties(device).total_memory
    try:
        with Path("/proc/meminfo").open(encoding="ascii") as file:
            found = next(line for line in file if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        raise InvalidInput(
            "the memory of this device is not known", where="--micro-batch", hint="Name a number."
        ) from None
    return 1024 * int(found.split()[1])


def counted_for(device: torch.device) -> AbstractContextManager[object]:
    """Return the context in which a forward pass on this processor saves what it would save on a device."""
    return nullcontext() if device.type == "cpu" else like_a_gpu()


@contextmanager
def matrices(bf16: bool) -> Iterator[None]:
    """Compute matrices in bfloat16, as training does where it is fast."""
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=bf16):
        yield
