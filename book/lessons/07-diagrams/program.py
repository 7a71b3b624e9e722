import semismooth as ss


def equation(x):
    y, a = x
    return [ss.minimum(abs(y - 2) + abs(a) - 1, y + 0.8 - 0.2 * a)]


island = ss.trace(equation, 2)
starts = ss.all_solutions(island, 0.5).points  # rows (y, a)
diagram = ss.diagram(island, starts, parameter_range=(-2.0, 2.0))
print(f"{len(starts)} starts, {len(diagram.isolas)} closed curve")
folds = [v for v in diagram.vertices if v.kind == "fold"]
for v in sorted(folds, key=lambda v: v.x[1]):
    print(f"  fold at a = {v.x[1]:.4f}, y = {v.x[0]:.4f}")
