//! Equalities that all pieces of a site have in common, though no row is the same in all of them.
//!
//! Where a node in space slipped before, it sticks (u̇_t = 0, two rows) or slips (two others), and in both cases it does not move normal to
//! the direction of the friction force: a common equality, in rows that mix it with another. Once it is separated, the pieces differ in one
//! form each, as in the plane, and the site is one of a linear complementarity problem ([`monotone`](super::monotone)).

use nalgebra::{DMatrix, DVector};

use super::system::{Site, System, scale_form};
use super::table::Form;
use crate::linear::{ACCURACY, NEGLIGIBLE};
use crate::tolerances::{HALF_DIGITS, STEPS};

impl System {
    /// For homogeneous forms: separates the equalities that all pieces of a site imply, as forms of their own, from those that remain for
    /// each piece.
    pub(super) fn tell_shared_equalities(&mut self) {
        self.sites.iter_mut().for_each(tell);
    }
}

fn tell(site: &mut Site) {
    let Some((first, others)) = site.pieces.split_first() else {
        return;
    };
    let literal = (first.equalities.iter()).filter(|f| others.iter().all(|p| p.equalities.contains(f)));
    let literal = literal.count();
    let all = || std::iter::once(first).chain(others);
    if others.is_empty() || all().any(|p| p.equalities.len() < literal + 2) {
        return;
    }
    let spaces: Vec<Space> = all().map(|p| Space::of(&p.equalities, &site.forms)).collect();
    let Some((space, rest)) = spaces.split_first() else {
        return;
    };
    let shared = rest
        .iter()
        .fold(space.clone(), |shared, other| shared.meet(other));
    if shared.basis.len() <= literal {
        return;
    }
    let own: Vec<Space> = spaces.iter().map(|space| space.without(&shared)).collect();
    // Forms of facets are kept, and are followed by the new ones.
    let kept = (0..site.forms.len()).filter(|f| all().any(|p| p.facets.iter().any(|facet| facet.0 == *f)));
    let kept: Vec<usize> = kept.collect();
    let mut forms: Vec<Form> = kept.iter().map(|&f| site.forms[f].clone()).collect();
    let common = forms.len()..forms.len() + shared.basis.len();
    forms.extend(shared.forms());
    let mut begins = Vec::with_capacity(own.len());
    for space in &own {
        begins.push(forms.len());
        forms.extend(space.forms());
    }
    for (k, piece) in site.pieces.iter_mut().enumerate() {
        piece.equalities = common
            .clone()
            .chain(begins[k]..begins[k] + own[k].basis.len())
            .collect();
        for facet in &mut piece.facets {
            let vector = DVector::from_column_slice(&site.forms[facet.0].coefficients);
            facet.0 = kept.iter().position(|f| *f == facet.0).unwrap_or(facet.0);
            // Between two pieces that differ in one form each, the facet of one is where the other begins.
            if let [a, b] = own.as_slice()
                && let ([a], [b]) = (a.basis.as_slice(), b.basis.as_slice())
            {
                let (own, other) = if k == 0 { (a, b) } else { (b, a) };
                if let Some(factor) = multiple(&vector, other, own, &shared) {
                    *facet = (begins[1 - k], facet.1 * factor.signum());
                }
            }
        }
    }
    site.forms = forms;
}

/// The factor of a form, where `vector` is a multiple of it on the space in which `own` and what is shared vanish.
fn multiple(vector: &DVector<f64>, form: &DVector<f64>, own: &DVector<f64>, shared: &Space) -> Option<f64> {
    let on = |v: &DVector<f64>| {
        let mut v = v.clone();
        shared.project_off(&mut v);
        v.axpy(-own.dot(&v), own, 1.0);
        v
    };
    let (size, v, b) = (vector.norm(), on(vector), on(form));
    let factor = v.dot(&b) / b.norm_squared();
    let off = (v - b.scale(factor)).norm();
    (off <= HALF_DIGITS * size && factor.abs() > HALF_DIGITS.sqrt() * size).then_some(factor)
}

/// A space of forms by an orthonormal basis, and an error bound of its vectors.
#[derive(Clone)]
struct Space {
    basis: Vec<DVector<f64>>,
    error: f64,
}

impl Space {
    fn of(equalities: &[usize], forms: &[Form]) -> Self {
        let forms = || equalities.iter().map(|&f| &forms[f]);
        let vectors: Vec<_> = forms()
            .map(|f| DVector::from_column_slice(&f.coefficients))
            .collect();
        let sizes: Vec<f64> = vectors.iter().map(|v| v.norm()).collect();
        let most = vectors.len();
        Self::spanned(
            vectors,
            &sizes,
            most,
            forms().map(|f| f.error).fold(0.0, f64::max),
        )
    }

    /// By pivoted Gram–Schmidt: a basis of at most the given number of the vectors, which had the given lengths, the longest remainder
    /// first.
    fn spanned(mut vectors: Vec<DVector<f64>>, sizes: &[f64], most: usize, error: f64) -> Self {
        let mut out = Self {
            basis: Vec::new(),
            error,
        };
        while out.basis.len() < most {
            let shares = vectors
                .iter()
                .zip(sizes)
                .map(|(v, size)| v.norm() / size)
                .enumerate();
            let longest = shares
                .filter(|s| s.1 > HALF_DIGITS)
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((k, share)) = longest else {
                break;
            };
            // Orthogonalised twice: the remainder may be small.
            let mut next = vectors[k].clone();
            out.project_off(&mut next);
            next.unscale_mut(next.norm());
            out.error = out.error.max(error / (share * sizes[k]));
            for v in &mut vectors {
                v.axpy(-next.dot(v), &next, 1.0);
            }
            out.basis.push(next);
        }
        out
    }

    fn project_off(&self, v: &mut DVector<f64>) {
        for b in &self.basis {
            v.axpy(-b.dot(v), b, 1.0);
        }
    }

    /// The intersection of both, within [`HALF_DIGITS`].
    fn meet(&self, other: &Self) -> Self {
        let mut out = Self {
            basis: Vec::new(),
            error: self.error.max(other.error),
        };
        let products = DMatrix::from_fn(self.basis.len(), other.basis.len(), |i, j| {
            // Squares of smaller ones are lost, and singular values with them.
            Some(self.basis[i].dot(&other.basis[j]))
                .filter(|v| v.abs() > NEGLIGIBLE)
                .unwrap_or(0.0)
        });
        if products.is_empty() || products.iter().any(|v| !v.is_finite()) {
            return out;
        }
        // The principal vectors (Björck, Golub 1973); angles from their remainders, as cosines near 1 are inaccurate.
        let sweeps = STEPS * products.nrows().max(products.ncols());
        let svd = products.try_svd_unordered(true, false, ACCURACY, sweeps);
        let Some(u) = svd
            .and_then(|svd| svd.u)
            .filter(|u| u.iter().all(|v| v.is_finite()))
        else {
            return out;
        };
        for column in u.column_iter() {
            let mut v = self.basis[0].scale(column[0]);
            for (b, c) in self.basis.iter().zip(column.iter()).skip(1) {
                v.axpy(*c, b, 1.0);
            }
            let mut left = v.clone();
            other.project_off(&mut left);
            if left.norm() <= HALF_DIGITS {
                out.error = out.error.max(left.norm());
                out.basis.push(v);
            }
        }
        out
    }

    /// The orthogonal complement of a subspace within this space.
    fn without(&self, part: &Self) -> Self {
        let mut vectors = self.basis.clone();
        vectors.iter_mut().for_each(|v| part.project_off(v));
        let left = self.basis.len() - part.basis.len();
        Self::spanned(
            vectors,
            &vec![1.0; self.basis.len()],
            left,
            self.error.max(part.error),
        )
    }

    fn forms(&self) -> impl Iterator<Item = Form> + '_ {
        self.basis.iter().map(|b| {
            let mut form = Form {
                coefficients: b.as_slice().to_vec(),
                constant: 0.0,
                error: self.error + f64::EPSILON,
            };
            scale_form(&mut form);
            form
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::system::Piece;
    use super::*;
    use crate::spread::Random;

    const UNKNOWNS: usize = 7;

    /// Rows with coefficients whose squares underflow: their spaces meet in e₂ + ¾ e₇ at most, and nothing panics.
    #[test]
    fn products_that_underflow_are_none() {
        let of = |rows: [[f64; 8]; 4]| {
            let forms = rows.map(|row| form(DVector::from_column_slice(&row)));
            Space::of(&[0, 1, 2, 3], &forms)
        };
        let first = of([
            [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0],
            [
                0.0,
                0.0,
                0.5,
                0.5,
                4.56405738634228e-142,
                0.0,
                0.5,
                2.5227428640080653e-143,
            ],
            [
                0.0,
                0.0,
                1.4050584278412112e-169,
                1.0,
                0.0,
                3.55302030414366e-169,
                0.5,
                0.0,
            ],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.75],
        ]);
        let second = of([
            [
                0.0,
                1.5826825114354521e-172,
                2.0559102618683647e-147,
                1.2035162379281114e-160,
                0.0,
                0.0,
                2.3953242574201636e-173,
                0.5,
            ],
            [
                0.0,
                0.5,
                0.75,
                0.0,
                1.7601026834081804e-155,
                1.0,
                4.9841284085524144e-166,
                0.0,
            ],
            [
                2.8316797680038182e-149,
                0.0,
                3.9651156842333586e-176,
                0.0,
                2.2020797880033802e-145,
                0.75,
                2.3252045091350515e-174,
                0.0,
            ],
            [
                0.0,
                0.0,
                1.0,
                4.055200018711271e-175,
                0.0,
                1.3696321060965355e-171,
                2.5706229494434256e-164,
                0.0,
            ],
        ]);
        for (one, other) in [(&first, &second), (&second, &first)] {
            let both = one.meet(other);
            for v in &both.basis {
                for space in [&first, &second] {
                    let mut left = v.clone();
                    space.project_off(&mut left);
                    assert!(left.norm() <= HALF_DIGITS, "{v}");
                }
            }
        }
    }

    fn form(coefficients: DVector<f64>) -> Form {
        Form {
            coefficients: coefficients.as_slice().to_vec(),
            constant: 0.0,
            error: 1e-15,
        }
    }

    fn random_vector(random: &mut Random) -> DVector<f64> {
        DVector::from_fn(UNKNOWNS, |_, _| random.symmetric())
    }

    /// Of vectors of different lengths the requested number, each with the largest remainder orthogonal to those before.
    #[test]
    fn spaces_have_as_many_dimensions_as_asked_for() {
        let mut random = Random::new(3);
        let vectors: Vec<_> = (0..4).map(|_| random_vector(&mut random)).collect();
        for most in 0..=4 {
            let space = Space::spanned(vectors.clone(), &[1.0; 4], most, 0.0);
            assert_eq!(space.basis.len(), most);
            for (i, a) in space.basis.iter().enumerate() {
                for (j, b) in space.basis.iter().enumerate() {
                    assert!((a.dot(b) - f64::from(i == j)).abs() < 1e-14);
                }
            }
        }
        let twice: Vec<_> = vectors.iter().chain(&vectors).cloned().collect();
        assert_eq!(Space::spanned(twice, &[1.0; 8], 8, 0.0).basis.len(), 4);
    }

    /// A site with the equalities s = a = 0 and s = b = 0 of its pieces in rows that mix the two, the cell of the first b ≥ 0 and that of
    /// the second a ≤ 0, in facets that add forms that vanish; perturbed by an angle.
    fn mixed(random: &mut Random, angle: f64) -> (Site, [DVector<f64>; 3]) {
        let [s, a, b] = [(); 3].map(|()| random_vector(random));
        let rows = |v: &DVector<f64>, random: &mut Random| {
            let off = random_vector(random) * angle;
            let (c, d) = (0.5 + random.symmetric().abs(), 0.4 * random.symmetric());
            [&s * c + v * d + off, &s * -d + v * c].map(form)
        };
        let (of_a, of_b) = (rows(&a, random), rows(&b, random));
        let mix = |v: &DVector<f64>, own: &DVector<f64>, random: &mut Random| {
            form(v * 0.8 + own * random.symmetric() + &s * random.symmetric())
        };
        let facets = [mix(&b, &a, random), mix(&a, &b, random)];
        let piece = |k: usize, equalities: Vec<usize>, sign: f64| Piece {
            pieces: vec![k],
            equalities,
            facets: vec![(k, sign)],
        };
        let site = Site {
            sites: vec![0],
            slots: vec![0],
            forms: facets.into_iter().chain(of_a).chain(of_b).collect(),
            pieces: vec![piece(0, vec![2, 3], 1.0), piece(1, vec![4, 5], -1.0)],
            implied: None,
        };
        (site, [s, a, b])
    }

    fn value(form: &Form, x: &DVector<f64>) -> f64 {
        DVector::from_column_slice(&form.coefficients).dot(x)
    }

    #[test]
    fn pieces_that_share_an_equality_in_mixed_rows_differ_in_one_form_each() {
        let mut random = Random::new(1);
        for _ in 0..100 {
            let (before, vectors) = mixed(&mut random, 1e-12);
            let mut site = before.clone();
            tell(&mut site);
            let [first, second] = [0, 1].map(|k| &site.pieces[k].equalities);
            assert_eq!((first.len(), second.len()), (2, 2));
            assert_eq!(first[0], second[0]);
            assert_ne!(first[1], second[1]);
            // On each piece's space the cell is the same, bounded by the form of the other.
            for (k, pair) in [[0, 1], [0, 2]].iter().enumerate() {
                let equalities = Space::spanned(pair.map(|v| vectors[v].clone()).to_vec(), &[1.0; 2], 2, 0.0);
                let mut x = random_vector(&mut random);
                equalities.project_off(&mut x);
                for &f in &site.pieces[k].equalities {
                    assert!(value(&site.forms[f], &x).abs() < 1e-9);
                }
                let (old, new) = (before.pieces[k].facets[0], site.pieces[k].facets[0]);
                assert_eq!(new.0, site.pieces[1 - k].equalities[1]);
                assert!(
                    old.1 * value(&before.forms[old.0], &x) * new.1 * value(&site.forms[new.0], &x) > 0.0
                );
            }
        }
    }

    /// Where rows are perturbed by an angle, shared forms vanish on each piece within their errors.
    #[test]
    fn errors_of_shared_forms_bound_what_they_miss() {
        let mut random = Random::new(3);
        for _ in 0..100 {
            let (before, _) = mixed(&mut random, 1e-9);
            let mut site = before.clone();
            tell(&mut site);
            for k in 0..2 {
                let form = &site.forms[site.pieces[k].equalities[0]];
                let space = Space::of(&before.pieces[k].equalities, &before.forms);
                let mut x = random_vector(&mut random);
                space.project_off(&mut x);
                let sum: f64 = x.iter().map(|v| v.abs()).sum();
                assert!(value(form, &x).abs() <= (4.0 * form.error + 1e-14) * sum);
            }
        }
    }

    /// Rows and their errors in smaller units span the same space with the same error.
    #[test]
    fn errors_of_spaces_are_relative_to_rows() {
        let mut random = Random::new(5);
        let forms = [(); 3].map(|()| form(random_vector(&mut random)));
        let error = Space::of(&[0, 1, 2], &forms).error;
        for unit in [-30, -3].map(|k| 2f64.powi(k)) {
            let scaled = forms.clone().map(|f| Form {
                coefficients: f.coefficients.iter().map(|a| a * unit).collect(),
                constant: 0.0,
                error: f.error * unit,
            });
            assert_eq!(Space::of(&[0, 1, 2], &scaled).error, error);
        }
    }

    /// A facet that is no multiple of the other piece's form stays what it is.
    #[test]
    fn other_facets_stay() {
        let mut random = Random::new(4);
        for _ in 0..100 {
            let (mut before, _) = mixed(&mut random, 0.0);
            for a in &mut before.forms[0].coefficients {
                *a += 1e-5 * random.symmetric();
            }
            let mut site = before.clone();
            tell(&mut site);
            let [first, second] = [0, 1].map(|k| site.pieces[k].facets[0]);
            assert_eq!((first.0, first.1), (0, before.pieces[0].facets[0].1));
            assert_eq!(site.forms[0].coefficients, before.forms[0].coefficients);
            assert_eq!(second.0, site.pieces[0].equalities[1]);
        }
    }

    #[test]
    fn pieces_that_share_nothing_stay_as_they_are() {
        let mut random = Random::new(2);
        for _ in 0..100 {
            let (before, _) = mixed(&mut random, 1e-5);
            let mut site = before.clone();
            tell(&mut site);
            assert_eq!(site.forms.len(), before.forms.len());
            assert_eq!(site.pieces[0].equalities, [2, 3]);
        }
    }
}
