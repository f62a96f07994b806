"""Query parameters of files made on request follow from the options of exports."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Literal

import pytest

from marey.api.making import query
from marey.motion.export_options import ExportOptions
from tests.support.document import openapi

PATH = "/v1/motions/{motion}/files/{format}"


def test_every_option_of_fixed_values_is_a_described_parameter() -> None:
    parameters = {each["name"]: each for each in openapi()["paths"][PATH]["get"]["parameters"]}
    closed = query.query_options()
    assert closed.keys() >= {"bvh_root", "root_bone", "in_place", "tpose_frame", "rest_pose", "placement", "mesh"}
    assert closed.keys() <= {each.name for each in fields(ExportOptions)}
    for name in closed:
        assert len(parameters[name]["description"]) > 20, name
    assert parameters["bvh_root"]["schema"]["enum"] == ["zero", "offset"]


@pytest.mark.parametrize(
    ("kind", "closed"),
    [
        (bool, True),
        (Literal["a", "b"], True),
        (Literal["a"] | None, True),
        (str, False),  # `?rig=/etc/passwd` must not name a file of the server
        (str | None, False),
        (Literal["a"] | str, False),
        (Path | None, False),
        (float, False),
    ],
)
def test_options_that_may_name_a_file_are_no_parameters(kind: object, closed: bool) -> None:
    assert query.is_closed(kind) is closed
