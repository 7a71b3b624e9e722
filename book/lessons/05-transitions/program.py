import semismooth as ss


def node(f_nu, f_t):
    def equations(x):
        u_nu, u_t, l_nu, l_t, F = x
        pressed = ss.maximum(l_nu + u_nu, 0)
        return [
            2 * u_nu - u_t + l_nu - f_nu,
            -u_nu + 2 * u_t + l_t - f_t,
            l_nu - pressed,
            l_t - ss.clip(l_t + u_t, -F * pressed, F * pressed),
        ]

    return equations


for f_nu, f_t in [(1.5, 7.0), (1.5, -4.0), (1.0, -2.0)]:
    print(f"f = ({f_nu}, {f_t})")
    start = [0, 0, f_nu, f_t, 8.0]
    branch = ss.follow(node(f_nu, f_t), start, (0.0, 8.0), "decreasing")
    for t in branch.transitions:
        print(f"  F = {t.parameter:.4f}: {t.kind}")
    print(f"  end: {branch.termination}")
