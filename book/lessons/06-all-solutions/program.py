import semismooth as ss


def equations(v):
    x, y, a = v
    return [abs(x) + y - a, 2 * y + min(x, 1)]


for a in [-1.0, 0.5, 2.0]:
    found = ss.all_solutions(equations, a)
    print(f"a = {a}: {len(found.points)} solutions, complete: {found.complete}")
    for x, y, _ in found.points:
        print(f"  x = {x:.4f}, y = {y:.4f}")
