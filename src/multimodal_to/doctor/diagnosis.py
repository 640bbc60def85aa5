"""What the doctor says: symptoms, each with its severity and what to change, and the diagnosis that they make."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from multimodal_to.arguments import checked


class Severity(Enum):
    """How bad a symptom is."""

    ERROR = "error"
    """No motion does what is asked: the task is refused."""
    WARNING = "warning"
    """It may well fail, but nothing proves that it has to."""
    NOTE = "note"
    """Worth knowing."""


@dataclass(frozen=True, kw_only=True)
class Symptom:
    """One thing found in a task."""

    name: str
    severity: Severity
    found: str  # with numbers and units
    change: str  # what to do about it; empty where nothing has to be done

    def __str__(self) -> str:
        return f"{self.name}: {self.found}{'; ' if self.change else ''}{self.change}"


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Everything found in a task, the worst first."""

    findings: tuple[Symptom, ...]

    def __post_init__(self) -> None:
        order = list(Severity)
        object.__setattr__(self, "findings", tuple(sorted(self.findings, key=lambda item: order.index(item.severity))))

    @checked
    def of(self, severity: Severity) -> tuple[Symptom, ...]:
        """Return the findings of a severity."""
        return tuple(finding for finding in self.findings if finding.severity is severity)

    @property
    def hopeless(self) -> bool:
        """Return whether no motion does what is asked."""
        return bool(self.of(Severity.ERROR))


def error(name: str, found: str, change: str) -> Symptom:
    """Return a symptom that makes the task hopeless.

    Args:
        name: which check found it.
        found: what is wrong, with numbers and units.
        change: what to do about it.
    """
    return Symptom(name=name, severity=Severity.ERROR, found=found, change=change)


def warning(name: str, found: str, change: str) -> Symptom:
    """Return a symptom that may make the solve fail.

    Args:
        name: which check found it.
        found: what may go wrong, with numbers and units.
        change: what to do about it.
    """
    return Symptom(name=name, severity=Severity.WARNING, found=found, change=change)


def note(name: str, found: str, change: str = "") -> Symptom:
    """Return something worth knowing.

    Args:
        name: which check found it.
        found: what is so, with numbers and units.
        change: what may be done about it.
    """
    return Symptom(name=name, severity=Severity.NOTE, found=found, change=change)
