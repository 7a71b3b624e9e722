"""Renders still_life.pgm, 256 x 256 grey values: three balls and a box on a chequered table before a papered wall. CC0."""
import math

N, RAYS = 256, 3
LIGHT = (-0.5, 0.75, -0.45)
BALLS = [((-0.45, 0.38, 1.9), 0.38, 0.85), ((0.4, 0.27, 1.6), 0.27, 0.45), ((0.02, 0.16, 1.25), 0.16, 0.95)]
BOX = ((0.35, 0.0, 2.1), (0.95, 0.8, 2.6), 0.6)
WALL = 3.0


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    length = math.sqrt(dot(a, a))
    return tuple(x / length for x in a)


def hit(origin, ray):
    """The nearest surface along a ray: distance, normal, grey value."""
    best = (math.inf, None, 0.0)
    for centre, radius, grey in BALLS:
        apart = tuple(o - c for o, c in zip(origin, centre))
        half, rest = dot(apart, ray), dot(apart, apart) - radius * radius
        root = half * half - rest
        if root > 0 and 1e-6 < -half - math.sqrt(root) < best[0]:
            t = -half - math.sqrt(root)
            best = (t, unit(tuple(a + t * r for a, r in zip(apart, ray))), grey)
    low, high, grey = BOX
    for axis in range(3):
        if abs(ray[axis]) > 1e-9:
            side = low if ray[axis] > 0 else high
            t = (side[axis] - origin[axis]) / ray[axis]
            point = [o + t * r for o, r in zip(origin, ray)]
            inside = all(low[k] <= point[k] <= high[k] for k in range(3) if k != axis)
            if inside and 1e-6 < t < best[0]:
                normal = [0.0] * 3
                normal[axis] = -math.copysign(1, ray[axis])
                best = (t, tuple(normal), grey)
    if ray[1] < -1e-9 and 1e-6 < -origin[1] / ray[1] < best[0]:
        t = -origin[1] / ray[1]
        x, z = origin[0] + t * ray[0], origin[2] + t * ray[2]
        best = (t, (0.0, 1.0, 0.0), 0.75 if (math.floor(4 * x) + math.floor(4 * z)) % 2 else 0.35)
    if ray[2] > 1e-9 and 1e-6 < (WALL - origin[2]) / ray[2] < best[0]:
        t = (WALL - origin[2]) / ray[2]
        x, y = origin[0] + t * ray[0], origin[1] + t * ray[1]
        paper = 0.6 + 0.1 * math.sin(14 * x) * math.sin(14 * y) + 0.05 * math.sin(40 * (x + y))
        best = (t, (0.0, 0.0, -1.0), paper)
    return best


def grey(x, y):
    eye = (0.0, 0.75, -0.6)
    ray = unit((x, y - 0.16, 1.3))
    t, normal, own = hit(eye, ray)
    if normal is None:
        return 0.0
    point = tuple(e + t * r for e, r in zip(eye, ray))
    to_light = unit(LIGHT)
    lit = max(dot(normal, to_light), 0.0)
    if hit(tuple(p + 1e-4 * n for p, n in zip(point, normal)), to_light)[0] < 2.5:
        lit = 0.0
    return own * (0.35 + 0.75 * lit)


def pixel(row, column):
    total = 0.0
    for a in range(RAYS):
        for b in range(RAYS):
            x = (column + (a + 0.5) / RAYS) / N - 0.5
            y = 0.5 - (row + (b + 0.5) / RAYS) / N
            total += grey(x, y)
    return min(max(total / RAYS**2, 0.0), 1.0)


with open("still_life.pgm", "wb") as file:
    file.write(b"P5\n%d %d\n255\n" % (N, N))
    file.write(bytes(round(255 * pixel(row, column)) for row in range(N) for column in range(N)))
