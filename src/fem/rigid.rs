//! Rigid motions which the supports leave free.

use super::mesh::{difference, norm};
use super::{FemError, Mesh};

/// Translations, then rotations about the axes.
const NAMES: [&str; 6] = [
    "translation along x",
    "translation along y",
    "translation along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
];

/// Checks that each connected part of the body is held.
pub(super) fn check_supports(mesh: &Mesh, fixed: &[bool]) -> Result<(), FemError> {
    let dim = mesh.dim();
    let part = parts(mesh);
    let number = part.iter().max().map_or(0, |m| m + 1);
    let mut centre = vec![[0.0; 3]; number];
    let mut count = vec![0.0; number];
    for (node, p) in mesh.points().iter().enumerate() {
        count[part[node]] += 1.0;
        for d in 0..3 {
            centre[part[node]][d] += p[d];
        }
    }
    for (c, n) in centre.iter_mut().zip(&count) {
        *c = c.map(|x| x / n);
    }
    let mut radius = vec![0.0f64; number];
    for (node, p) in mesh.points().iter().enumerate() {
        let r = &mut radius[part[node]];
        *r = r.max(norm(difference(*p, centre[part[node]])));
    }
    // Gram matrices of the rigid modes on the prescribed components, rotations scaled by the size of the part.
    let mut gram = vec![[[0.0; 6]; 6]; number];
    for (node, p) in mesh.points().iter().enumerate() {
        let own = part[node];
        let x = difference(*p, centre[own]).map(|v| v / radius[own]);
        let modes: [[f64; 3]; 6] = [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, -x[2], x[1]],
            [x[2], 0.0, -x[0]],
            [-x[1], x[0], 0.0],
        ];
        for d in (0..dim).filter(|&d| fixed[dim * node + d]) {
            for i in 0..6 {
                for j in 0..6 {
                    gram[own][i][j] += modes[i][d] * modes[j][d];
                }
            }
        }
    }
    let wanted: &[usize] = if dim == 2 { &[0, 1, 5] } else { &[0, 1, 2, 3, 4, 5] };
    for (own, g) in gram.iter_mut().enumerate() {
        let scale = wanted.iter().map(|&i| g[i][i]).fold(0.0, f64::max);
        let mut free = Vec::new();
        for (k, &i) in wanted.iter().enumerate() {
            if scale == 0.0 || g[i][i] <= 1e-12 * scale {
                free.push(NAMES[i]);
                continue;
            }
            for &r in &wanted[k + 1..] {
                let factor = g[r][i] / g[i][i];
                for &c in &wanted[k..] {
                    g[r][c] -= factor * g[i][c];
                }
            }
        }
        if !free.is_empty() {
            let mut modes = free.join(", ");
            if number > 1 {
                modes += &format!(
                    " (of the part number {own} of {number} that is round ({:.3}, {:.3}, {:.3}))",
                    centre[own][0], centre[own][1], centre[own][2]
                );
            }
            return Err(FemError::Floating { modes });
        }
    }
    Ok(())
}

/// Number of the connected part of each node.
fn parts(mesh: &Mesh) -> Vec<usize> {
    fn root(parent: &mut [usize], mut n: usize) -> usize {
        while parent[n] != n {
            parent[n] = parent[parent[n]];
            n = parent[n];
        }
        n
    }
    let mut parent: Vec<usize> = (0..mesh.num_nodes()).collect();
    for cell in 0..mesh.num_cells() {
        let nodes = mesh.cell(cell);
        let first = root(&mut parent, nodes[0]);
        for &n in &nodes[1..] {
            let other = root(&mut parent, n);
            parent[other] = first;
        }
    }
    let mut number = vec![usize::MAX; parent.len()];
    let mut count = 0;
    (0..parent.len())
        .map(|n| {
            let r = root(&mut parent, n);
            if number[r] == usize::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect()
}
