"""A small share of the fuzz run in benchmarks/: mutated files are read, or refused by errors of the library."""

from __future__ import annotations

from pathlib import Path

import pytest

import fuzz

COUNT = 200


@pytest.mark.parametrize("kind", fuzz.KINDS)
def test_mutated_files_are_read_or_refused(kind, tmp_path):
    result = fuzz.run(kind, COUNT, 2, tmp_path)
    assert not result.failures, result.failures[0][1]
    refused = sum(count for ending, count in result.endings.items() if ending.endswith("Error"))
    assert refused + result.endings["read"] == COUNT
    assert 0.3 * COUNT < refused < COUNT  # the mutations do break files, and not all of them


def test_a_reader_that_crashes_hangs_or_executes_something_is_a_failure(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "PATIENCE", 0.05)
    monkeypatch.setattr(fuzz.Trap, "marker", str(tmp_path / "executed"))

    def loops(path: Path) -> None:
        while True:
            pass

    for reader, ending in (
        (lambda path: {}["x"], "KeyError"),
        (loops, "Hang"),
        (lambda path: (tmp_path / "executed").mkdir(), "executed"),
    ):
        found, fault = fuzz.outcome(reader, tmp_path / "in", b"")
        assert found == ending
        assert fault
