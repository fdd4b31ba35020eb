"""What a result was computed on."""

import platform
from importlib.metadata import version

from symoden.experiments import machine_facts


def test_the_machine_is_described_without_its_name():
    facts = machine_facts()
    assert {"processor", "cores", "Python", "symoden", "jax"} <= set(facts)
    assert facts["Python"] == platform.python_version()
    assert facts["jax"] == version("jax")
    assert int(facts["cores"]) >= 1
    assert all(facts.values())
    private = [platform.node(), "/home"]
    assert not any(word and word in text for word in private for text in facts.values())
