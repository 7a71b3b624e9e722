import semismooth as ss

for a in [5.0, 8.0]:
    result = ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [2.0 - a, 4.0 - a])
    print(f"a = {a}: {result.status}, q = ({result.x[0]:.4f}, {result.x[1]:.4f})")


def market(x):
    q1, q2, a = x
    return [
        ss.minimum(q1, 2 * q1 + q2 + 2 - a),
        ss.minimum(q2, q1 + 2 * q2 + 4 - a),
    ]


branch = ss.follow(market, [0.0, 0.0, 0.0], parameter_range=(0.0, 10.0))
for t in branch.transitions:
    print(f"at a = {t.x[2]:.4f}: {t.kind}")
