import semismooth as ss

island = ss.trace(lambda x: [ss.minimum(abs(x[0] - 2) + abs(x[1]) - 1, x[0] + 0.8 - 0.2 * x[1])], 2)
starts = ss.all_solutions(island, 0.5).points  # rows (y, a)
diagram = ss.diagram(island, starts, parameter_range=(-2.0, 2.0))
print(f"{len(starts)} starts, {len(diagram.isolas)} closed curve")
for v in sorted((v for v in diagram.vertices if v.kind == "fold"), key=lambda v: v.x[1]):
    print(f"  fold at a = {v.x[1]:.4f}, y = {v.x[0]:.4f}")
