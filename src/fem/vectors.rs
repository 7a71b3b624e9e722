//! Vectors in space, and lists of nodes.

/// Sorted nodes, padded.
pub(super) fn key(nodes: impl Iterator<Item = usize>) -> [usize; 4] {
    let mut key = [usize::MAX; 4];
    for (k, n) in key.iter_mut().zip(nodes) {
        *k = n;
    }
    key.sort_unstable();
    key
}

pub(super) fn mean(points: impl ExactSizeIterator<Item = [f64; 3]>) -> [f64; 3] {
    let scale = 1.0 / points.len() as f64;
    let mut sum = [0.0; 3];
    for p in points {
        for d in 0..3 {
            sum[d] += p[d];
        }
    }
    sum.map(|s| s * scale)
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// By x, then y, then z.
pub(super) fn by_position(p: [f64; 3], q: [f64; 3]) -> std::cmp::Ordering {
    p[0].total_cmp(&q[0])
        .then(p[1].total_cmp(&q[1]))
        .then(p[2].total_cmp(&q[2]))
}
