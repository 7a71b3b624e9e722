//! Unsupported pieces (connected parts) of a body.

use crate::contact::ContactError;
use crate::sparse::{NodalBlocks, NodalMatrix, Place, Resistance, Symmetric, pieces};
use crate::tolerances::CHECKED;

/// The first piece (set of coupled nodes) with zero-energy rigid motions. Components of the nodes in `contacts` are along their frames.
pub(in crate::contact) fn floating_piece(
    stiffness: &NodalMatrix,
    contacts: &[usize],
    frames: &[[[f64; 3]; 3]],
) -> Option<ContactError> {
    let mut frame = vec![None; stiffness.num_nodes()];
    for (node, own) in contacts.iter().zip(frames) {
        frame[*node] = Some(own);
    }
    let points = stiffness.points();
    let (number, modes) = match &stiffness.blocks {
        NodalBlocks::Plane(a) => floating(a, points, &frame),
        NodalBlocks::Space(a) => floating(a, points, &frame),
    }?;
    let (dim, places) = (stiffness.dim(), stiffness.places());
    let displacement = places.iter().position(|p| number[*p as usize / dim])?;
    Some(ContactError::Unsupported {
        displacement,
        at: Some(points[places[displacement] as usize / dim]),
        modes: modes.join(", "),
    })
}

/// The nodes of that piece, and its zero-energy motions.
fn floating<const F: usize>(
    a: &Symmetric<F>,
    points: &[[f64; 3]],
    frame: &[Option<&[[f64; 3]; 3]>],
) -> Option<(Vec<bool>, Vec<&'static str>)> {
    let piece = connected(a);
    let places = Place::of(points, &piece);
    // By component, then by motion.
    let motions = |node: usize| -> [[f64; 6]; F] {
        let free = places[piece[node]].motions(points[node]);
        std::array::from_fn(|d| {
            free.map(|m| match frame[node] {
                Some(frame) => (0..F).map(|k| frame[d][k] * m[k]).sum(),
                None => m[d],
            })
        })
    };
    let mut held = vec![Resistance::default(); places.len()];
    // A rotation about a line through all nodes moves none of them: it does not count.
    let mut moved = held.clone();
    for i in 0..a.nrows() {
        motions(i).iter().for_each(|m| moved[piece[i]].add(m));
        let (mut force, mut terms) = ([[0.0; 6]; F], [0.0; F]);
        a.each(i, |j, block| {
            let motions = motions(j);
            for (r, row) in block.iter().enumerate() {
                for (v, m) in row.iter().zip(&motions) {
                    terms[r] += v.abs();
                    force[r].iter_mut().zip(m).for_each(|(f, m)| *f += v * m);
                }
            }
        });
        for (force, terms) in force.iter().zip(terms) {
            if force.iter().any(|f| f.abs() > CHECKED * terms) {
                held[piece[i]].add(&force.map(|f| f / terms));
            }
        }
    }
    let free = held.iter().zip(&moved).map(|(held, moved)| -> Vec<_> {
        let none = moved.free(F);
        held.free(F).into_iter().filter(|m| !none.contains(m)).collect()
    });
    let (own, modes) = free.enumerate().find(|(_, free)| !free.is_empty())?;
    Some((piece.iter().map(|p| *p == own).collect(), modes))
}

/// The piece of each node.
fn connected<const F: usize>(a: &Symmetric<F>) -> Vec<usize> {
    pieces(a.nrows(), |connect| {
        for i in 0..a.nrows() {
            let (cols, values) = a.lower().row(i);
            let coupled = cols
                .iter()
                .zip(values)
                .filter(|(_, v)| v.as_flattened().iter().any(|v| *v != 0.0));
            connect(&mut std::iter::once(i).chain(coupled.map(|(j, _)| *j as usize)));
        }
    })
}

/// The piece of each node.
pub(super) fn pieces_of(stiffness: &NodalMatrix) -> Vec<usize> {
    match &stiffness.blocks {
        NodalBlocks::Plane(a) => connected(a),
        NodalBlocks::Space(a) => connected(a),
    }
}
