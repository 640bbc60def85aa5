"""`Lifted`: quantities through which many variables act on a term, and second derivatives by the chain rule over them.

Automatic differentiation takes one sweep through a function for about each entry of the Hessian's longest row. Of a
torque, that row has the base's orientation and twist, the joints' positions and both velocities of an interval; with
a few quantities in between it has the joints' positions and these.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as cs

from multimodal_to.adam.spatial import SX

Lift = Callable[[SX], SX]
"""Returns what a term reads in place of an expression: a symbol for it, or the expression itself."""


def not_lifted(expression: SX) -> SX:
    """Return the expression itself."""
    return expression


class Lifted:
    """Quantities u₁ = g₁(z), u₂ = g₂(z, u₁), …: terms read the symbol u_k for the expression g_k."""

    def __init__(self) -> None:
        self._symbols: list[SX] = []
        self._values: list[SX] = []

    def __call__(self, expression: SX) -> SX:
        """Return a symbol that stands for an expression, (m, 1), of variables and of earlier symbols."""
        symbol = cs.SX.sym(f"lifted_{len(self._symbols)}", *expression.shape)
        self._symbols.append(symbol)
        self._values.append(expression)
        return symbol

    def expand(self, expression: SX) -> SX:
        """Return an expression of the variables alone."""
        symbols, values = list[SX](), list[SX]()
        for symbol, value in zip(self._symbols, self._values, strict=True):
            values.append(cs.substitute([value], symbols, values)[0] if symbols else value)
            symbols.append(symbol)
        return cs.substitute([expression], symbols, values)[0] if symbols else expression

    def hessian(self, function: SX, variables: SX) -> SX:
        """Return ∇²f of the variables, the upper triangle.

        From the last quantity to the first, u = g(y) of all before it is taken out of f(y, u):
        ∇²f ← f_yy + Gᵀ f_uy + f_yu G + Gᵀ f_uu G + Σ_i f_u,i ∇²g_i and ∇f ← f_y + Gᵀ f_u, with G = ∂g/∂y.

        Args:
            function: f of the variables and the symbols, (1, 1).
            variables: z, (n, 1).
        """
        symbols, values = self._of(function)
        every = cs.vertcat(variables, *symbols)
        upper, gradient = cs.hessian(function, every)
        hessian = cs.triu2symm(cs.triu(upper))
        for symbol, value in zip(reversed(symbols), reversed(values), strict=True):
            first = gradient.shape[0] - symbol.shape[0]
            before, slope = every[:first], gradient[first:]
            jacobian = cs.jacobian(value, before)
            half = hessian[first:, :first] + 0.5 * (hessian[first:, first:] @ jacobian)
            product = jacobian.T @ half
            fixed = cs.SX.sym("slope", slope.shape[0])  # the curvature of g alone, whatever the slope depends on
            curvature = cs.substitute(cs.hessian(cs.dot(fixed, value), before)[0], fixed, slope)
            total = hessian[:first, :first] + product + product.T + curvature
            hessian = cs.triu2symm(cs.sparsify(cs.triu(total)))
            gradient = gradient[:first] + jacobian.T @ slope
        return self.expand(cs.triu(hessian))

    def _of(self, function: SX) -> tuple[list[SX], list[SX]]:
        """Return the symbols that a function depends on, directly or through others, and their expressions."""
        symbols, values = list[SX](), list[SX]()
        for symbol, value in zip(reversed(self._symbols), reversed(self._values), strict=True):
            if cs.depends_on(cs.vertcat(function, *values), symbol):
                symbols.insert(0, symbol)
                values.insert(0, value)
        return symbols, values
