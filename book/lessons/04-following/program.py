import semismooth as ss


def beam(x):
    y, load = x
    return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]


branch = ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
for t in branch.transitions:
    print(f"load {t.x[1]:.4f}, deflection {t.x[0]:.4f}: {t.kind}")
