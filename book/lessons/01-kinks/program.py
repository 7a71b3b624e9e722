import semismooth as ss


def spring(y, load):
    right = ss.maximum(y[0] - 1, 0, name="right stop")
    left = ss.maximum(-y[0] - 1, 0, name="left stop")
    return [y[0] + 9 * right - 9 * left - load[0]]


recorded = ss.trace(lambda x: spring(x[:1], x[1:]), 2)
print(f"{recorded.num_sites} sites")
# The load that holds the spring at y, and the change of y when the load grows or
# falls by one: the inverse of H'(y; ±1).
for y, load in [(0.5, 0.5), (1.0, 1.0), (1.5, 6.0)]:
    s = ss.sensitivity(spring, [y], [load])
    more, less = s.jvp([1.0])[0], s.jvp([-1.0])[0]
    print(f"y = {y}: {recorded.pieces([y, load])}")
    print(f"  one more: {more:+.1f}, one less: {less:+.1f}; derivative: {s.differentiable}")
