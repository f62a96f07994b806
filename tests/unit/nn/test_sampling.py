"""Random numbers and drawing."""

from __future__ import annotations

import numpy as np
import torch

from marey.nn.sampling import guide, sample_top_k, uniform


def numbers(seeds: list[int], stream: int = 1, step: int = 1, count: int = 64) -> torch.Tensor:
    return uniform(torch.tensor(seeds), stream, step, torch.arange(count))


def test_a_number_depends_on_seed_stream_step_and_position_only() -> None:
    together = numbers([3, 7, 3])
    assert torch.equal(together[0], numbers([3])[0])
    assert torch.equal(together[1, :10], numbers([7], count=10)[0])
    assert torch.equal(together[0], together[2])
    for other in (numbers([4]), numbers([3], stream=2), numbers([3], step=2)):
        assert not (other[0] == together[0]).any()


def test_the_first_numbers_never_change() -> None:
    # reference: SplitMix64 in Python's unbounded integers
    mask, golden = (1 << 64) - 1, 0x9E3779B97F4A7C15

    def mix(z: int) -> int:
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        return z ^ (z >> 31)

    def reference(seed: int, stream: int, step: int, position: int) -> float:
        key = mix((mix((seed + stream * golden) & mask) + step * golden) & mask)
        return ((mix((key + (position + 1) * golden) & mask) >> 41) + 0.5) * 2.0**-23

    found = uniform(torch.tensor([0, 2**31 - 1]), 2, 9, torch.arange(5))
    expected = [[reference(seed, 2, 9, p) for p in range(5)] for seed in (0, 2**31 - 1)]
    assert found.tolist() == expected


def test_numbers_are_uniform_and_never_0_or_1() -> None:
    values = numbers(list(range(2000)), count=50).flatten().numpy()
    assert values.min() > 0
    assert values.max() < 1
    counts, _ = np.histogram(values, bins=20, range=(0, 1))
    assert abs(counts / len(values) - 0.05).max() < 0.003
    pairs = np.corrcoef(values[:-1], values[1:])[0, 1]
    assert abs(pairs) < 0.01


def test_guidance_of_one_is_the_conditional_branch() -> None:
    c, u = torch.randn(3, 5), torch.randn(3, 5)
    torch.testing.assert_close(guide(c, u, 1.0), c)
    torch.testing.assert_close(guide(c, u, 0.0), u)
    torch.testing.assert_close(guide(c, u, 4.0), u + 4 * (c - u))


def test_draws_follow_the_softmax_of_the_kept_logits() -> None:
    probability = torch.tensor([0.5, 0.3, 0.15, 0.05])
    noise = torch.linspace(0.0005, 0.9995, 1000)
    logits = probability.log().expand(1000, 4)
    drawn = sample_top_k(logits, noise, temperature=1.0, share=1.0)
    share = torch.bincount(drawn, minlength=4) / 1000
    torch.testing.assert_close(share, probability, atol=0.002, rtol=0)
    half = sample_top_k(logits, noise, temperature=1.0, share=0.5)
    torch.testing.assert_close(
        torch.bincount(half, minlength=4) / 1000, torch.tensor([0.625, 0.375, 0, 0]), atol=2e-3, rtol=0
    )


def test_temperature_works_on_logits() -> None:
    probability = torch.tensor([0.8, 0.2])
    noise = torch.linspace(0.0005, 0.9995, 1000)
    drawn = sample_top_k(probability.log().expand(1000, 2), noise, temperature=0.5, share=1.0)
    assert abs(float((drawn == 0).float().mean()) - 0.64 / 0.68) < 0.002


def test_the_smallest_share_and_no_temperature_take_the_likeliest() -> None:
    logits = torch.randn(50, 512)
    noise = torch.rand(50)
    best = logits.argmax(-1)
    assert torch.equal(sample_top_k(logits, noise, temperature=1.0, share=1 / 512), best)
    assert torch.equal(sample_top_k(logits, noise, temperature=0.0, share=1.0), best)


def test_a_tenth_of_512_codes_is_52() -> None:
    noise = torch.linspace(0.00005, 0.99995, 10000)
    drawn = sample_top_k(torch.arange(512.0).expand(10000, 512) * 1e-3, noise, temperature=1.0, share=0.1)
    assert drawn.unique().tolist() == list(range(460, 512))
