//! Families of problems in Delassus form with the structure of multibody contact: M = H W Hᵀ of rigid bodies, in most of them with far more
//! contact unknowns than degrees of freedom.
#![allow(dead_code)]

use super::random::Random;
use semismooth::contact::DelassusProblem;
use semismooth::sparse::Matrix;

pub type V3 = [f64; 3];

pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn unit(a: V3) -> V3 {
    let s = dot(a, a).sqrt();
    a.map(|v| v / s)
}

/// A rigid body: centre, inverse mass, inverse inertia about the axes, velocity and spin.
#[derive(Clone, Copy)]
pub struct Body {
    pub centre: V3,
    pub mass: f64,
    pub inertia: V3,
    pub velocity: V3,
    pub spin: V3,
}

/// A contact between two bodies (`None` is the ground): the normal points from `under` to `over`.
#[derive(Clone, Copy)]
pub struct Touch {
    pub over: usize,
    pub under: Option<usize>,
    pub point: V3,
    pub normal: V3,
}

/// Rows of H of one contact for a body: 3 × 6, in the frame (N, T1, T2).
fn rows(frame: [V3; 3], arm: V3, sign: f64) -> [[f64; 6]; 3] {
    frame.map(|e| {
        let m = cross(arm, e);
        [e[0], e[1], e[2], m[0], m[1], m[2]].map(|v| sign * v)
    })
}

/// The problem of a set of bodies; `dimension` 2 drops the second tangent (which is then along z).
pub fn assemble(dimension: usize, bodies: &[Body], touches: &[Touch], mu: f64) -> DelassusProblem {
    assemble_turning(dimension, bodies, touches, mu, 0.0)
}

/// The same with bodies that rotate by `angle` in a step: the rotational part of W is the inverse of the inertia plus a gyroscopic term, M
/// is unsymmetric, and its rank and range are those of H.
pub fn assemble_turning(
    dimension: usize,
    bodies: &[Body],
    touches: &[Touch],
    mu: f64,
    angle: f64,
) -> DelassusProblem {
    let mut turns = Random::new(17);
    let mut by_body: Vec<Vec<(usize, [[f64; 6]; 3])>> = vec![Vec::new(); bodies.len()];
    for (k, t) in touches.iter().enumerate() {
        let n = unit(t.normal);
        let frame = if dimension == 2 {
            [n, [-n[1], n[0], 0.0], [0.0, 0.0, 1.0]]
        } else {
            let helper = if n[0].abs() < 0.6 {
                [1.0, 0.0, 0.0]
            } else {
                [0.0, 1.0, 0.0]
            };
            let t1 = unit(cross(n, helper));
            [n, t1, cross(n, t1)]
        };
        by_body[t.over].push((k, rows(frame, sub(t.point, bodies[t.over].centre), 1.0)));
        if let Some(b) = t.under {
            by_body[b].push((k, rows(frame, sub(t.point, bodies[b].centre), -1.0)));
        }
    }
    let n = dimension * touches.len();
    let mut triplets = Vec::new();
    let mut q = vec![0.0; n];
    for (body, list) in bodies.iter().zip(&by_body) {
        let w: [f64; 6] = std::array::from_fn(|k| {
            if k < 3 {
                1.0 / body.mass
            } else {
                1.0 / body.inertia[k - 3]
            }
        });
        let v: [f64; 6] = std::array::from_fn(|k| if k < 3 { body.velocity[k] } else { body.spin[k - 3] });
        // (1 + [a]×)⁻¹ = (1 + a aᵀ − [a]×) / (1 + a·a), between the roots of the inertia.
        let a: V3 = std::array::from_fn(|_| angle * turns.between(-1.0, 1.0));
        let turn: [V3; 3] = std::array::from_fn(|i| {
            let unit: V3 = std::array::from_fn(|k| f64::from(i == k));
            let across = cross(a, unit);
            std::array::from_fn(|k| (unit[k] + a[i] * a[k] + across[k]) / (1.0 + dot(a, a)))
        });
        let w_times = |h: &[f64; 6]| -> [f64; 6] {
            std::array::from_fn(|k| {
                if k < 3 {
                    return w[k] * h[k];
                }
                (0..3)
                    .map(|l| w[k].sqrt() * turn[k - 3][l] * w[3 + l].sqrt() * h[3 + l])
                    .sum()
            })
        };
        for (i, hi) in list {
            for a in 0..dimension {
                q[i * dimension + a] += (0..6).map(|k| hi[a][k] * v[k]).sum::<f64>();
                for (j, hj) in list {
                    for c in 0..dimension {
                        let moved = w_times(&hj[c]);
                        let m: f64 = (0..6).map(|k| hi[a][k] * moved[k]).sum();
                        triplets.push((i * dimension + a, j * dimension + c, m));
                    }
                }
            }
        }
    }
    let m = Matrix::from_triplets(n, n, &triplets).unwrap();
    DelassusProblem::new(dimension, m, q, vec![mu; touches.len()]).unwrap()
}

fn brick(centre: V3, size: V3, density: f64, velocity: V3) -> Body {
    let mass = density * size[0] * size[1] * size[2];
    let s = size.map(|v| v * v);
    Body {
        centre,
        mass,
        inertia: [s[1] + s[2], s[0] + s[2], s[0] + s[1]].map(|v| v * mass / 12.0),
        velocity,
        spin: [0.0; 3],
    }
}

/// A wall of bricks in stretcher bond: each brick touches those below at the four corners of every common face.
pub fn wall(courses: usize, length: usize, mu: f64, push: f64, seed: u64) -> DelassusProblem {
    turning_wall(courses, length, mu, push, 0.0, seed)
}

/// The wall with bricks that rotate by `angle` in a step.
pub fn turning_wall(
    courses: usize,
    length: usize,
    mu: f64,
    push: f64,
    angle: f64,
    seed: u64,
) -> DelassusProblem {
    let mut s = Random::new(seed);
    let (lx, ly, lz) = (2.0, 1.0, 0.7);
    let mut bodies: Vec<Body> = Vec::new();
    let mut touches = Vec::new();
    let mut below: Vec<usize> = Vec::new();
    for c in 0..courses {
        let shift = if c % 2 == 0 { 0.0 } else { 0.5 * lx };
        let mut here = Vec::new();
        for k in 0..length {
            let x = shift + lx * k as f64;
            let z = lz * (c as f64 + 0.5);
            let velocity = [push * s.between(0.5, 1.5), push * s.between(-0.2, 0.2), -9.81e-3];
            bodies.push(brick([x, 0.0, z], [lx, ly, lz], s.between(0.8, 1.2), velocity));
            let over = bodies.len() - 1;
            here.push(over);
            let mut face = |under: Option<usize>, x0: f64, x1: f64| {
                for px in [x0, x1] {
                    for py in [-0.5 * ly, 0.5 * ly] {
                        let point = [px, py, z - 0.5 * lz];
                        touches.push(Touch {
                            over,
                            under,
                            point,
                            normal: [0.0, 0.0, 1.0],
                        });
                    }
                }
            };
            if c == 0 {
                face(None, x - 0.5 * lx, x + 0.5 * lx);
            }
            for &b in &below {
                let xb: f64 = bodies[b].centre[0];
                let (x0, x1) = (
                    (x - 0.5 * lx).max(xb - 0.5 * lx),
                    (x + 0.5 * lx).min(xb + 0.5 * lx),
                );
                if x1 > x0 + 1e-9 {
                    face(Some(b), x0, x1);
                }
            }
            if k > 0 {
                let px = x - 0.5 * lx;
                for py in [-0.5 * ly, 0.5 * ly] {
                    for pz in [-0.5 * lz, 0.5 * lz] {
                        touches.push(Touch {
                            over,
                            under: Some(over - 1),
                            point: [px, py, z + pz],
                            normal: [1.0, 0.0, 0.0],
                        });
                    }
                }
            }
        }
        below = here;
    }
    assemble_turning(3, &bodies, &touches, mu, angle)
}

/// Rods in a heap: layer upon layer crosswise at random angles, each with two or three contacts with those below and, side by side, two
/// redundant contacts along the common generator; thrown with spin.
pub fn rods(layers: usize, breadth: usize, mu: f64, shake: f64, angle: f64, seed: u64) -> DelassusProblem {
    let mut s = Random::new(seed);
    let (radius, half) = (0.5, 0.5 * breadth as f64);
    let mut bodies: Vec<Body> = Vec::new();
    let mut touches = Vec::new();
    for c in 0..layers {
        let z = radius * (2 * c + 1) as f64;
        for k in 0..breadth {
            let side = 2.0 * radius * (k as f64 - 0.5 * (breadth as f64 - 1.0));
            let turned = c % 2 == 1;
            let centre = if turned { [side, 0.0, z] } else { [0.0, side, z] };
            let mass = s.between(0.3, 3.0);
            let (long, round) = (mass * half * half / 3.0, 0.5 * mass * radius * radius);
            bodies.push(Body {
                centre,
                mass,
                inertia: if turned {
                    [long, round, long]
                } else {
                    [round, long, long]
                },
                velocity: [shake * s.between(-1.0, 1.0), shake * s.between(-1.0, 1.0), -0.01],
                spin: s.vector(3, shake).try_into().unwrap(),
            });
            let over = bodies.len() - 1;
            let along: V3 = if turned { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
            let tilt = |s: &mut Random, n: V3| {
                unit([n[0] + s.between(-0.1, 0.1), n[1] + s.between(-0.1, 0.1), n[2]])
            };
            if c == 0 {
                for end in [-half, 0.0, half] {
                    let point = [centre[0] + end * along[0], centre[1] + end * along[1], 0.0];
                    touches.push(Touch {
                        over,
                        under: None,
                        point,
                        normal: [0.0, 0.0, 1.0],
                    });
                }
            } else {
                for under in breadth * (c - 1)..breadth * c {
                    if s.between(0.0, 1.0) < 0.3 {
                        continue;
                    }
                    let other = bodies[under].centre;
                    let point = if turned {
                        [centre[0], other[1], z - radius]
                    } else {
                        [other[0], centre[1], z - radius]
                    };
                    let normal = tilt(&mut s, [0.0, 0.0, 1.0]);
                    touches.push(Touch {
                        over,
                        under: Some(under),
                        point,
                        normal,
                    });
                }
            }
            if k > 0 {
                for end in [-0.8 * half, 0.8 * half] {
                    let across: V3 = if turned { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
                    let point = std::array::from_fn(|d| centre[d] + end * along[d] - radius * across[d]);
                    touches.push(Touch {
                        over,
                        under: Some(over - 1),
                        point,
                        normal: across,
                    });
                }
            }
        }
    }
    assemble_turning(3, &bodies, &touches, mu, angle)
}

/// A tower of planks laid crosswise, three per storey, with four contacts at each crossing.
pub fn tower(storeys: usize, mu: f64, lean: f64, seed: u64) -> DelassusProblem {
    let mut s = Random::new(seed);
    let size = [3.0, 1.0, 0.5];
    let mut bodies: Vec<Body> = Vec::new();
    let mut touches = Vec::new();
    for c in 0..storeys {
        let z = size[2] * (c as f64 + 0.5);
        for k in 0..3 {
            let off = k as f64 - 1.0 + s.between(-0.05, 0.05);
            let turned = c % 2 == 1;
            let (centre, dims) = if turned {
                ([off, 0.0, z], [0.9, 3.0, 0.5])
            } else {
                ([0.0, off, z], [3.0, 0.9, 0.5])
            };
            let velocity = [lean * s.between(-1.0, 1.0), lean * s.between(-1.0, 1.0), -0.01];
            bodies.push(brick(centre, dims, 1.0, velocity));
            let over = bodies.len() - 1;
            let unders: Vec<Option<usize>> = if c == 0 {
                vec![None]
            } else {
                (3 * (c - 1)..3 * c).map(Some).collect()
            };
            for under in unders {
                let other = under.map_or([0.0, 0.0], |b| [bodies[b].centre[0], bodies[b].centre[1]]);
                let (cx, cy) = match (under, turned) {
                    (None, _) => (centre[0], centre[1]),
                    (_, true) => (centre[0], other[1]),
                    (_, false) => (other[0], centre[1]),
                };
                let (hx, hy) = if under.is_none() {
                    (0.5 * dims[0], 0.5 * dims[1])
                } else {
                    (0.45, 0.45)
                };
                for (dx, dy) in [(-hx, -hy), (hx, -hy), (-hx, hy), (hx, hy)] {
                    let point = [cx + dx, cy + dy, z - 0.25];
                    touches.push(Touch {
                        over,
                        under,
                        point,
                        normal: [0.0, 0.0, 1.0],
                    });
                }
            }
        }
    }
    assemble(3, &bodies, &touches, mu)
}

/// A packing of spheres on a jittered lattice in a box: near neighbours and walls touch.
pub fn packing(side: [usize; 3], mu: f64, shake: f64, ratio: f64, seed: u64) -> DelassusProblem {
    let mut s = Random::new(seed);
    let mut bodies = Vec::new();
    let at = |i: usize, j: usize, k: usize| (k * side[1] + j) * side[0] + i;
    for k in 0..side[2] {
        for j in 0..side[1] {
            for i in 0..side[0] {
                let jitter = 0.15;
                let centre = [
                    i as f64 + s.between(-jitter, jitter),
                    j as f64 + s.between(-jitter, jitter),
                    k as f64 + s.between(-jitter, jitter),
                ];
                let mass = ratio.powf(s.between(0.0, 1.0));
                bodies.push(Body {
                    centre,
                    mass,
                    inertia: [0.4 * mass * 0.25; 3],
                    velocity: [shake * s.between(-1.0, 1.0), shake * s.between(-1.0, 1.0), -0.01],
                    spin: [shake * s.between(-1.0, 1.0); 3],
                });
            }
        }
    }
    let mut touches = Vec::new();
    for k in 0..side[2] {
        for j in 0..side[1] {
            for i in 0..side[0] {
                let over = at(i, j, k);
                let mut near = |under: Option<usize>, normal: V3| {
                    let c = bodies[over].centre;
                    let point = [
                        c[0] - 0.5 * normal[0],
                        c[1] - 0.5 * normal[1],
                        c[2] - 0.5 * normal[2],
                    ];
                    touches.push(Touch {
                        over,
                        under,
                        point,
                        normal,
                    });
                };
                if k == 0 {
                    near(None, [0.0, 0.0, 1.0]);
                }
                if i == 0 {
                    near(None, [1.0, 0.0, 0.0]);
                }
                if i == side[0] - 1 {
                    near(None, [-1.0, 0.0, 0.0]);
                }
                if j == 0 {
                    near(None, [0.0, 1.0, 0.0]);
                }
                if j == side[1] - 1 {
                    near(None, [0.0, -1.0, 0.0]);
                }
                for (di, dj, dk) in [(1, 0, 0), (0, 1, 0), (0, 0, 1)] {
                    if i >= di && j >= dj && k >= dk {
                        let b = at(i - di, j - dj, k - dk);
                        near(Some(b), unit(sub(bodies[over].centre, bodies[b].centre)));
                    }
                }
            }
        }
    }
    assemble(3, &bodies, &touches, mu)
}

/// Discs in a planar heap, hexagonal with jitter.
pub fn discs(rows: usize, columns: usize, mu: f64, shake: f64, seed: u64) -> DelassusProblem {
    let mut s = Random::new(seed);
    let mut bodies = Vec::new();
    for k in 0..rows {
        for i in 0..columns {
            let jitter = 0.05;
            let x = i as f64 + if k % 2 == 1 { 0.5 } else { 0.0 };
            let mass = s.between(0.5, 2.0);
            bodies.push(Body {
                centre: [
                    x + s.between(-jitter, jitter),
                    0.87 * k as f64 + s.between(-jitter, jitter),
                    0.0,
                ],
                mass,
                inertia: [0.125 * mass; 3],
                velocity: [shake * s.between(-1.0, 1.0), -0.01, 0.0],
                spin: [0.0, 0.0, shake * s.between(-1.0, 1.0)],
            });
        }
    }
    let mut touches = Vec::new();
    for over in 0..bodies.len() {
        let c = bodies[over].centre;
        if over < columns {
            touches.push(Touch {
                over,
                under: None,
                point: [c[0], c[1] - 0.5, 0.0],
                normal: [0.0, 1.0, 0.0],
            });
        }
        if over % columns == 0 {
            touches.push(Touch {
                over,
                under: None,
                point: [c[0] - 0.5, c[1], 0.0],
                normal: [1.0, 0.0, 0.0],
            });
        }
        if over % columns == columns - 1 {
            touches.push(Touch {
                over,
                under: None,
                point: [c[0] + 0.5, c[1], 0.0],
                normal: [-1.0, 0.0, 0.0],
            });
        }
        for under in 0..over {
            let d = sub(c, bodies[under].centre);
            if dot(d, d).sqrt() < 1.15 {
                let n = unit(d);
                touches.push(Touch {
                    over,
                    under: Some(under),
                    point: [c[0] - 0.5 * n[0], c[1] - 0.5 * n[1], 0.0],
                    normal: n,
                });
            }
        }
    }
    assemble(2, &bodies, &touches, mu)
}

/// An arch of wedges between two fixed abutments, four contacts per joint (two in the plane): it stands by friction alone.
pub fn arch(dimension: usize, wedges: usize, mu: f64, load: f64) -> DelassusProblem {
    let (inner, outer) = (4.0, 5.0);
    let mid = 0.5 * (inner + outer);
    let step = std::f64::consts::PI / wedges as f64;
    let mut bodies = Vec::new();
    let mut touches = Vec::new();
    for k in 0..wedges {
        let a = step * (k as f64 + 0.5);
        let heavy = if k == wedges / 3 { load } else { 1.0 };
        let centre = [mid * a.cos(), mid * a.sin(), 0.0];
        let mut b = brick(centre, [1.0, step * mid, 1.0], 1.0, [0.0, -0.01 * heavy, 0.0]);
        let i = b.inertia[2];
        b.inertia = [i; 3];
        bodies.push(b);
    }
    for k in 0..=wedges {
        let a = step * k as f64;
        let along = [-a.sin(), a.cos(), 0.0];
        for radius in [inner, outer] {
            for depth in if dimension == 2 {
                vec![0.0]
            } else {
                vec![-0.5, 0.5]
            } {
                let point = [radius * a.cos(), radius * a.sin(), depth];
                let touch = if k == wedges {
                    Touch {
                        over: wedges - 1,
                        under: None,
                        point,
                        normal: along.map(|v| -v),
                    }
                } else {
                    Touch {
                        over: k,
                        under: k.checked_sub(1),
                        point,
                        normal: along,
                    }
                };
                touches.push(touch);
            }
        }
    }
    assemble(dimension, &bodies, &touches, mu)
}

/// M = H Hᵀ of random H with `freedom` columns; q = H v (in the range) or any; entries of M perturbed by `skew`.
pub fn random(
    dimension: usize,
    contacts: usize,
    freedom: usize,
    mu: f64,
    in_range: bool,
    skew: f64,
    seed: u64,
) -> DelassusProblem {
    let mut s = Random::new(seed);
    let n = dimension * contacts;
    let h: Vec<Vec<f64>> = (0..n).map(|_| s.vector(freedom, 1.0)).collect();
    let v = s.vector(freedom, 1.0);
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| {
                    let m: f64 = h[i].iter().zip(&h[j]).map(|(a, b)| a * b).sum();
                    m * (1.0 + skew * s.between(-1.0, 1.0))
                })
                .collect()
        })
        .collect();
    let q = (0..n)
        .map(|i| {
            let free: f64 = h[i].iter().zip(&v).map(|(a, b)| a * b).sum();
            if in_range {
                free
            } else {
                free + s.between(-0.5, 0.5)
            }
        })
        .collect();
    let friction = (0..contacts).map(|_| mu * s.between(0.2, 1.0)).collect();
    DelassusProblem::new(dimension, Matrix::from_rows(&rows).unwrap(), q, friction).unwrap()
}

/// Points of an elastic half-space: M dense, definite, with a rapidly decaying spectrum.
pub fn half_space(side: usize, mu: f64, seed: u64) -> DelassusProblem {
    let mut s = Random::new(seed);
    let nc = side * side;
    let n = 3 * nc;
    let at = |i: usize| [(i % side) as f64, (i / side) as f64];
    let mut rows = vec![vec![0.0; n]; n];
    for i in 0..nc {
        for j in 0..nc {
            let (a, b) = (at(i), at(j));
            let d = ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt();
            let g = (-0.5 * d * d / 4.0).exp();
            for k in 0..3 {
                rows[3 * i + k][3 * j + k] = g * if k == 0 { 1.0 } else { 1.3 };
            }
            // Coupling of pressure and tangential displacement, skew in space.
            for (k, e) in [(1, a[0] - b[0]), (2, a[1] - b[1])] {
                rows[3 * i][3 * j + k] = 0.15 * g * e;
                rows[3 * j + k][3 * i] = 0.15 * g * e;
            }
        }
    }
    let q = (0..n)
        .map(|i| {
            if i % 3 == 0 {
                -1.0 + s.between(0.0, 1.2)
            } else {
                s.between(-0.5, 0.5)
            }
        })
        .collect();
    DelassusProblem::new(3, Matrix::from_rows(&rows).unwrap(), q, vec![mu; nc]).unwrap()
}
