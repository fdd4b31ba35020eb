"""Faulty versions of jaxlib are told what to leave."""

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError

import pytest

from symoden import _jaxlib

FLAG = "--xla_cpu_experimental_ynn_fusion_type"


@pytest.mark.parametrize(
    ("given", "jaxlib", "left"),
    [
        ("", "0.10.2", f"{FLAG}=-reduce"),
        ("--xla_dump_to=d", "0.11.0", f"--xla_dump_to=d {FLAG}=-reduce"),
        (f"{FLAG}=reduce", "0.10.2", f"{FLAG}=reduce"),
        ("", "0.10.1", ""),
        ("", "0.12.0", ""),
    ],
)
def test_only_faulty_versions_are_told_and_what_the_user_says_holds(monkeypatch, given, jaxlib, left):
    monkeypatch.setenv("XLA_FLAGS", given)
    monkeypatch.setattr(_jaxlib, "version", {"jaxlib": jaxlib}.__getitem__)
    _jaxlib.avoid_faults()
    assert os.environ["XLA_FLAGS"] == left


def test_without_jaxlib_nothing_is_said(monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(_jaxlib, "version", missing)
    _jaxlib.avoid_faults()
    assert os.environ["XLA_FLAGS"] == ""


def test_a_sum_that_ended_the_process_on_some_processors_is_computed():
    program = """
import symoden, jax, jax.numpy as jnp
u = jnp.ones((3, 1, 2, 2, 8, 8, 8), jnp.float32)
print(jax.jit(lambda a, b: jnp.sum(a * b, axis=3))(u, u).sum())
"""
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False, env=environment
    )
    assert ended.returncode == 0
    assert float(ended.stdout) == 3 * 2 * 2 * 8**3
