"""Text in arrays of foreign files."""

from __future__ import annotations

import numpy as np
import pytest

from marey.core.arrays import check_array
from marey.core.errors import InvalidFile


@pytest.mark.parametrize("order", "<>")
def test_numbers_that_are_no_characters_are_refused(order):
    good = np.array("über", f"{order}U4")
    assert check_array(good, "a", "x", kinds="U", shape=()) is good
    bad = np.array([0x61, 0x110000], f"{order}u4").view(f"{order}U2")[0:1]
    with pytest.raises(InvalidFile, match="not Unicode"):
        check_array(bad, "a", "x", kinds="U", shape=(1,))
