"""`Formulation`: what the optimal control problem is made of."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from multimodal_to.arguments import check, check_fields, checked
from multimodal_to.errors import FormulationError, listed, shown, unknown
from multimodal_to.models.units import OwnSize
from multimodal_to.ocp import margins, paper
from multimodal_to.ocp.integration import BACKWARD_EULER, LEAPFROG, IntegrationRule
from multimodal_to.ocp.knot import VARIABLE_NAMES
from multimodal_to.ocp.terms import Constraint, Cost, Term
from multimodal_to.ocp.variables import INTERVAL_SCALE, VARIABLES, Variable
from multimodal_to.trajectory import rules


@dataclass(frozen=True, kw_only=True)
class Formulation:
    """The decision variables of a knot, the integration rule, and the terms: constraints and costs, each with a name.

    Raises:
        FormulationError: a name stands twice, a variable is missing, or something is no term.
    """

    variables: tuple[Variable, ...] = VARIABLES
    rule: IntegrationRule = BACKWARD_EULER
    terms: tuple[Term, ...]
    interval_scale: float | OwnSize = INTERVAL_SCALE  # the size of Δt that the solver sees as one [s]

    def __post_init__(self) -> None:
        check_fields(self, FormulationError, but=("terms",))
        check("terms", self.terms, Sequence, FormulationError)
        object.__setattr__(self, "terms", tuple(self.terms))
        object.__setattr__(self, "variables", tuple(self.variables))
        for term in self.terms:
            if not isinstance(term, Constraint | Cost):
                raise FormulationError(f"{shown(term)} is no term; expected a Constraint or a Cost")
        for kind, entries in (("term", self.terms), ("variable", self.variables)):
            counts = Counter(entry.name for entry in entries)
            if twice := [name for name, count in counts.items() if count > 1]:
                raise FormulationError(f"the {kind} name {listed(twice)} is taken already; expected each name once")
        if missing := [name for name in VARIABLE_NAMES if name not in {variable.name for variable in self.variables}]:
            raise FormulationError(f"the formulation lacks the variables {listed(missing)}")
        if extra := [variable.name for variable in self.variables if variable.name not in VARIABLE_NAMES]:
            raise FormulationError(f"{listed(extra)} cannot be variables; expected {listed(VARIABLE_NAMES)}")
        interval = self.interval_scale.value if isinstance(self.interval_scale, OwnSize) else self.interval_scale
        if not 0 < interval < math.inf:
            raise FormulationError(f"interval_scale is {interval}; expected a positive number [s]")

    @classmethod
    def paper(cls) -> Formulation:
        """Return the problem of L'Erario et al. 2022, for a scenario of `scenarios.paper`."""
        return cls(terms=paper.TERMS)

    @classmethod
    def executable(cls) -> Formulation:
        """Return the problem whose plans a robot can carry out, which `build` takes by default.

        Beside the paper's terms it holds the scenario's `Margins`, and it integrates by leapfrog, of order two: the
        motion is what its forces make of it between the knots too. A force acts half an interval before and after its
        knot, so its foot is on the ground at the knots before and after as well.
        """
        terms = (margins.FRICTION_CONE if term is paper.FRICTION_CONE else term for term in paper.TERMS)
        return cls(terms=(*terms, *paper.LEAPFROG, *margins.TERMS), rule=LEAPFROG)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Return the constraints, in order."""
        return tuple(term for term in self.terms if isinstance(term, Constraint))

    @property
    def lazy_terms(self) -> frozenset[str]:
        """Return the names of the constraints whose rows are lazy."""
        return frozenset(term.name for term in self.constraints if term.lazy)

    @property
    def costs(self) -> tuple[Cost, ...]:
        """Return the costs, in order."""
        return tuple(term for term in self.terms if isinstance(term, Cost))

    @cached_property
    def own_terms(self) -> tuple[str, ...]:
        """Return the names of the terms that `of_rule` does not have for this rule."""
        usual = self._usual.terms
        return tuple(term.name for term in self.terms if term not in usual)

    @cached_property
    def left_out(self) -> tuple[str, ...]:
        """Return the names of the terms that `of_rule` has for this rule and that are not among these."""
        mine = {term.name for term in self.terms}
        return tuple(term.name for term in self._usual.terms if term.name not in mine)

    @property
    def _usual(self) -> Formulation:
        return Formulation.executable() if self.rule == LEAPFROG else Formulation.paper()

    @checked
    def with_terms(self, *terms: Term) -> Formulation:
        """Return the formulation with more terms.

        Raises:
            FormulationError: a name is taken already.
        """
        return replace(self, terms=(*self.terms, *terms))

    @checked
    def without(self, *names: str) -> Formulation:
        """Return the formulation without the terms of these names.

        Raises:
            FormulationError: there is no term of a name.
        """
        known = [term.name for term in self.terms]
        for name in names:
            if name not in known:
                raise FormulationError(unknown("term", name, known))
        return replace(self, terms=tuple(term for term in self.terms if term.name not in names))

    @checked
    def with_scales(self, scales: Mapping[str, float]) -> Formulation:
        """Return the formulation with other sizes of variables that the solver sees as one, by name [own unit].

        Raises:
            FormulationError: there is no variable of a name, or a scale is no positive number.
        """
        known = [variable.name for variable in self.variables]
        for name in scales:
            if name not in known:
                raise FormulationError(unknown("variable", name, known))
        changed = (Variable(entry.name, scales.get(entry.name, entry.scale)) for entry in self.variables)
        return replace(self, variables=tuple(changed))

    @classmethod
    @checked
    def of_rule(cls, name: str) -> Formulation:
        """Return the formulation that integrates by the rule of a name, as a trajectory's file says it.

        Raises:
            FormulationError: there is no rule of that name.
        """
        known = {rules.BACKWARD_EULER: cls.paper, rules.LEAPFROG: cls.executable}
        if name not in known:
            raise FormulationError(unknown("integration rule", name, known))
        return known[name]()

    def described(self) -> dict[str, object]:
        """Return what the record of a solve says of the formulation: its rule, and what differs from the paper's."""
        return {"rule": self.rule.name, "own_terms": list(self.own_terms), "left_out": list(self.left_out)}
