import semismooth as ss

pair = ss.trace(lambda v: [abs(v[0]) + v[1] - v[2], 2 * v[1] + ss.minimum(v[0], 1)], 3)
for a in [-1.0, 0.5, 2.0]:
    found = ss.all_solutions(pair, a)
    print(f"a = {a}: {len(found.points)} solutions, complete: {found.complete}")
    for x, y, _ in found.points:
        print(f"  x = {x:.4f}, y = {y:.4f}")
