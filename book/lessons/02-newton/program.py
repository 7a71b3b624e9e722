import numpy as np
import semismooth as ss

# y plus the projection of 2 y on [−1, 1]: full Newton steps repeat themselves.
saturating = ss.solve(lambda y: [y[0] + ss.clip(2 * y[0], -1, 1)], [1.0])
print(f"y + P(2 y) from y = 1: {saturating.status}, y = {abs(saturating.x[0]):.1f}")

# exp(y) − 1 + max(y, 0): the zero lies in the kink.
at_the_kink = ss.solve(lambda y: [np.exp(y[0]) - 1 + ss.maximum(y[0], 0)], [-2.0])
print(f"exp(y) − 1 + max(y, 0) from y = −2: {at_the_kink.status}, {at_the_kink.residual < 1e-10}")

# Its solution as a function of the right side has a kink there, too: 1 to the left,
# ½ to the right.
s = ss.sensitivity(
    lambda y, p: [np.exp(y[0]) - 1 + ss.maximum(y[0], 0) - p[0]], [0.0], [0.0]
)
print(f"derivative: {s.differentiable}; {s.jvp([1.0])[0]:.2f} and {s.jvp([-1.0])[0]:.2f}")
