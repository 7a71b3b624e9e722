//! Independent of the crate's solvers: residuals and complete enumeration.

use semismooth::contact::DelassusProblem;

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn velocities(p: &DelassusProblem, r: &[f64]) -> Vec<f64> {
    let mut u = p.q().to_vec();
    for (i, j, v) in p.matrix().triplets() {
        u[i] += v * r[j];
    }
    u
}

/// ‖r − P_K(r − û)‖ of one contact, by definition: P_K from the Moreau decomposition along the generator.
fn violation(mu: f64, r: &[f64], u: &[f64]) -> f64 {
    let d = r.len();
    let z: Vec<f64> = (0..d)
        .map(|k| r[k] - u[k] - if k == 0 { mu * norm(&u[1..]) } else { 0.0 })
        .collect();
    let t = norm(&z[1..]);
    let nearest = if t <= mu * z[0] && z[0] >= 0.0 {
        z.clone()
    } else {
        // The nearest point of the ray spanned by g = (1, μ z_T/‖z_T‖), or the apex.
        let g: Vec<f64> = (0..d)
            .map(|k| {
                if k == 0 {
                    1.0
                } else if t > 0.0 {
                    mu * z[k] / t
                } else {
                    0.0
                }
            })
            .collect();
        let along: f64 = z.iter().zip(&g).map(|(a, b)| a * b).sum::<f64>() / (1.0 + mu * mu);
        g.iter().map(|v| along.max(0.0) * v).collect()
    };
    norm(&r.iter().zip(&nearest).map(|(a, b)| a - b).collect::<Vec<_>>())
}

/// ‖r − P_K(r − û)‖ / max(‖q‖, ‖r‖, ‖u‖) in the units of the problem.
pub fn residual(p: &DelassusProblem, r: &[f64]) -> f64 {
    let d = p.dimension();
    let u = velocities(p, r);
    let all: Vec<f64> = (p.friction().iter().enumerate())
        .map(|(i, &mu)| violation(mu, &r[d * i..d * (i + 1)], &u[d * i..d * (i + 1)]))
        .collect();
    let size = norm(p.q()).max(norm(r)).max(norm(&u));
    if size == 0.0 { 0.0 } else { norm(&all) / size }
}

/// The same contact by contact, scaled to unit mean diagonals and relative to the largest of r, u, q and the products M_ij r_j there; the
/// maximum.
pub fn worst(p: &DelassusProblem, r: &[f64]) -> f64 {
    let (d, nc) = (p.dimension(), p.contacts());
    let u = velocities(p, r);
    let mut products = vec![vec![[0.0; 3]; nc]; nc];
    let mut mean = vec![0.0; nc];
    for (i, j, v) in p.matrix().triplets() {
        products[i / d][j / d][i % d] += v * r[j];
        if i == j {
            mean[i / d] += v / d as f64;
        }
    }
    let at = |v: &[f64], i: usize, factor: f64| -> Vec<f64> {
        v[d * i..d * (i + 1)].iter().map(|x| factor * x).collect()
    };
    // Immobile contacts take the scale of the others.
    let largest = mean.iter().fold(0.0_f64, |m, v| m.max(*v));
    for v in mean.iter_mut().filter(|v| **v <= 1e-13 * largest) {
        *v = if largest > 0.0 { largest } else { 1.0 };
    }
    let mut worst = 0.0_f64;
    for (i, &mu) in p.friction().iter().enumerate() {
        let s = mean[i].sqrt();
        // (s r, u / s) have the same unit.
        let (rs, us, qs) = (at(r, i, s), at(&u, i, 1.0 / s), at(p.q(), i, 1.0 / s));
        let size = products[i].iter().map(|m| norm(m) / s).fold(norm(&rs), f64::max);
        let error = violation(mu, &rs, &us);
        if error > 0.0 {
            worst = worst.max(error / size.max(norm(&us)).max(norm(&qs)));
        }
    }
    worst
}

/// Gaussian elimination with partial pivoting; `None` if a pivot vanishes.
pub fn gauss(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[pivot][k].abs() < 1e-11 {
            return None;
        }
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let f = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= f * a[k][j];
            }
            b[i] -= f * b[k];
        }
    }
    for k in (0..n).rev() {
        let tail: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - tail) / a[k][k];
    }
    Some(b)
}

/// All solutions with regular pieces of a planar problem: open, stick, slip+, slip− at each contact.
pub fn planar_solutions(m: &[Vec<f64>], q: &[f64], friction: &[f64]) -> Vec<Vec<f64>> {
    let n = q.len();
    let nc = n / 2;
    let unit = |i: usize| (0..n).map(|j| f64::from(i == j)).collect::<Vec<f64>>();
    let mut found = Vec::new();
    for code in 0..4_usize.pow(nc as u32) {
        let piece = |i: usize| code / 4_usize.pow(i as u32) % 4;
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for i in 0..nc {
            let (normal, tangent) = (2 * i, 2 * i + 1);
            if piece(i) == 0 {
                a.extend([unit(normal), unit(tangent)]);
                b.extend([0.0, 0.0]);
                continue;
            }
            a.push(m[normal].clone());
            b.push(-q[normal]);
            if piece(i) == 1 {
                a.push(m[tangent].clone());
                b.push(-q[tangent]);
            } else {
                // Slip+ is u_T > 0, so r_T = −μ r_N.
                let mut row = unit(tangent);
                row[normal] = if piece(i) == 2 { friction[i] } else { -friction[i] };
                a.push(row);
                b.push(0.0);
            }
        }
        let Some(r) = gauss(a, b) else { continue };
        let u: Vec<f64> = (0..n)
            .map(|i| q[i] + m[i].iter().zip(&r).map(|(a, b)| a * b).sum::<f64>())
            .collect();
        let e = 1e-10;
        let fits = (0..nc).all(|i| {
            let (rn, rt, un, ut) = (r[2 * i], r[2 * i + 1], u[2 * i], u[2 * i + 1]);
            match piece(i) {
                0 => un >= -e,
                1 => rn >= -e && rt.abs() <= friction[i] * rn + e,
                2 => rn >= -e && ut >= -e,
                _ => rn >= -e && ut <= e,
            }
        });
        if fits {
            found.push(r);
        }
    }
    found
}

/// The solution of 0 ≤ x ⟂ M x + q ≥ 0 for a definite M.
pub fn lcp(m: &[Vec<f64>], q: &[f64]) -> Vec<f64> {
    let n = q.len();
    for code in 0..1_usize << n {
        let active = |i: usize| code >> i & 1 == 1;
        let a = (0..n)
            .map(|i| {
                if active(i) {
                    m[i].clone()
                } else {
                    (0..n).map(|j| f64::from(i == j)).collect()
                }
            })
            .collect();
        let b = (0..n).map(|i| if active(i) { -q[i] } else { 0.0 }).collect();
        let Some(x) = gauss(a, b) else { continue };
        let fits = (0..n).all(|i| {
            let y: f64 = q[i] + m[i].iter().zip(&x).map(|(a, b)| a * b).sum::<f64>();
            x[i] >= -1e-11 && y >= -1e-11
        });
        if fits {
            return x;
        }
    }
    Vec::new()
}
