import semismooth as ss

# max(y, 0) + c min(y, 0) = p at y = 0: for c > 0 the solution is a Lipschitz function
# of p with one-sided derivatives, for c < 0 two solutions appear on one side and
# none is left on the other.
for c in [0.25, -0.25]:
    def H(y, p, c=c):
        return [ss.maximum(y[0], 0) + c * ss.minimum(y[0], 0) - p[0]]

    s = ss.sensitivity(H, [0.0], [0.0])
    print(f"c = {c}: derivative: {s.differentiable}")
    for direction in [1.0, -1.0]:
        arms, complete = s.branches([direction])
        told = "all of them" if complete else "perhaps more"
        values = ", ".join(f"{direction:+.0f} → {y:+.0f}" for y in sorted(arms[:, 0]))
        print(f"  p = {direction:+.0f}: {len(arms)} one-sided solutions, {told}; {values}")
