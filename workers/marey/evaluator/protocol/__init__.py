"""The protocol of Guo et al. 2022 ("Generating Diverse and Natural 3D Human Motions from Text") by which text-to-motion
models are compared: every repeat generates the captions of the test split anew.

Numbers are comparable only by the same evaluator on the same data: every row names both.
"""

from marey.evaluator.protocol.run import Judge, ProtocolOptions, Subject, run_protocol

__all__ = ["Judge", "ProtocolOptions", "Subject", "run_protocol"]
