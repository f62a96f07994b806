"""The variety that a model declares."""

from __future__ import annotations

import pytest

from marey.registry import ModelSpec, Setting, Variety


def test_a_variety_changes_settings_of_its_model_only() -> None:
    setting = Setting("heat", 0.0, 2.0, 1.0)
    fine = Variety(low={"heat": 0.5}, high={"heat": 1.5})
    assert ModelSpec("toy", "Toy", "A toy.", "a:b", "a:c", (setting,), variety=fine).variety == fine
    with pytest.raises(ValueError, match="'cold', which is none of its settings"):
        ModelSpec("toy", "Toy", "A toy.", "a:b", "a:c", (setting,), variety=Variety(low={}, high={"cold": 2.0}))
