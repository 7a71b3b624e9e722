use std::path::Path;

use semismooth::sparse::{
    Matrix, NodalMatrix, Pattern, parse_matrix_market, parse_substructure, parse_vector, read_matrix_market,
    read_substructure, read_vector, write_matrix_market,
};

use super::table::{BAD, Table, rows};

#[test]
fn sparse_matrices() {
    let mut t = Table::new("sparse");
    let a = || rows(&[&[1.0, 2.0], &[3.0, 4.0]]);
    const MAX: usize = usize::MAX;

    let from_csc = "sparse::Pattern::from_csc";
    t.refuses(from_csc, "no pointers", "column pointers", || {
        Pattern::from_csc(1, 1, vec![], vec![])
    });
    t.refuses(from_csc, "no pointers, no columns", "column pointers", || {
        Pattern::from_csc(0, 0, vec![], vec![])
    });
    t.refuses(from_csc, "usize::MAX columns", "column pointers", || {
        Pattern::from_csc(1, MAX, vec![0], vec![])
    });
    t.refuses(from_csc, "a row out of range", "(1, 0)", || {
        Pattern::from_csc(1, 1, vec![0, 1], vec![1])
    });
    t.refuses(from_csc, "repeated rows", "column 0", || {
        Pattern::from_csc(2, 1, vec![0, 2], vec![1, 1])
    });
    t.refuses(from_csc, "falling pointers", "pointer 1", || {
        Pattern::from_csc(2, 2, vec![0, 2, 1], vec![0])
    });
    t.refuses(from_csc, "a pointer out of range", "pointer 1", || {
        Pattern::from_csc(2, 2, vec![0, MAX, 1], vec![0])
    });
    t.holds(
        "sparse::Pattern::from_entries",
        "usize::MAX rows are not full",
        || Pattern::from_entries(MAX, 2, []).is_ok_and(|p| !p.is_full()),
    );
    // The first row alone announces 80 GB.
    let mut ragged = vec![vec![]; 100_000];
    ragged[0] = vec![0.0; 100_000];
    t.refuses("sparse::Matrix::from_rows", "rows of two lengths", "row", || {
        Matrix::from_rows(&ragged)
    });
    for rows in [1_usize << 31, 1 << 26] {
        t.refuses(
            "sparse::parse_matrix_market",
            "rows without entries",
            "rows",
            || {
                parse_matrix_market(&format!(
                    "%%MatrixMarket matrix coordinate real general\n{rows} 1 0\n"
                ))
            },
        );
    }
    t.holds(
        "sparse::parse_matrix_market",
        "ten million empty rows may be meant",
        || {
            let a =
                parse_matrix_market("%%MatrixMarket matrix coordinate real general\n10000000 1 1\n7 1 1\n");
            a.is_ok_and(|a| a.nrows() == 10_000_000 && a.get(6, 0) == 1.0)
        },
    );
    let from_entries = "sparse::Pattern::from_entries";
    t.refuses(from_entries, "an entry outside", "(0, 7)", || {
        Pattern::from_entries(1, 2, [(0, 7)])
    });
    t.refuses(from_entries, "usize::MAX columns", "columns", || {
        Pattern::from_entries(1, MAX, [(0, 0)])
    });
    t.refuses(from_entries, "2^60 columns", "columns", || {
        Pattern::from_entries(1, 1 << 60, [(0, 0)])
    });
    t.refuses(
        "sparse::Matrix::from_triplets",
        "an entry outside",
        "(2, 0)",
        || Matrix::from_triplets(2, 2, &[(2, 0, 1.0)]),
    );
    t.refuses("sparse::Matrix::from_triplets", "2^60 columns", "columns", || {
        Matrix::from_triplets(1, 1 << 60, &[])
    });
    t.refuses(
        "sparse::Matrix::from_values",
        "one value for four",
        "values",
        || Matrix::from_values(Pattern::full(2, 2), vec![1.0]),
    );
    t.refuses("sparse::Matrix::from_rows", "uneven rows", "row", || {
        Matrix::from_rows(&[vec![1.0, 2.0], vec![1.0]])
    });
    for bad in BAD {
        t.refuses(
            "sparse::Matrix::check_finite",
            "NaN or infinity",
            "(0, 1)",
            || rows(&[&[1.0, bad]]).check_finite(),
        );
    }

    let nodal = "sparse::NodalMatrix::new";
    let with = |a: &Matrix, unknowns: &[[usize; 2]], dim| NodalMatrix::new(a, vec![[0.0; 3]], unknowns, dim);
    for dim in [0, 1, 4, MAX] {
        t.refuses(nodal, "dimension", "dimension", || {
            with(&a(), &[[0, 0], [0, 1]], dim)
        });
    }
    t.refuses(nodal, "a matrix that is not symmetric", "symmetric", || {
        with(&a(), &[[0, 0], [0, 1]], 2)
    });
    let unit = Matrix::identity(2);
    t.refuses(nodal, "too few unknowns", "1 unknowns", || {
        with(&unit, &[[0, 0]], 2)
    });
    t.refuses(nodal, "one unknown twice", "two unknowns", || {
        with(&unit, &[[0, 0], [0, 0]], 2)
    });
    t.refuses(nodal, "a node that does not exist", "node 1", || {
        with(&unit, &[[0, 0], [1, 0]], 2)
    });
    t.refuses(nodal, "a component that does not exist", "component 2", || {
        with(&unit, &[[0, 0], [0, 2]], 2)
    });
    t.refuses(nodal, "a node without unknowns", "node 1", || {
        NodalMatrix::new(&unit, vec![[0.0; 3]; 2], &[[0, 0], [0, 1]], 2)
    });
    for bad in BAD {
        t.refuses(nodal, "a position", "position", || {
            NodalMatrix::new(&unit, vec![[0.0, bad, 0.0]], &[[0, 0], [0, 1]], 2)
        });
        t.refuses(nodal, "an entry", "(0, 0)", || {
            with(&rows(&[&[bad, 0.0], &[0.0, 1.0]]), &[[0, 0], [0, 1]], 2)
        });
    }
    t.holds("sparse::NodalMatrix::to_matrix", "the way back", || {
        let a = with(&unit, &[[0, 1], [0, 0]], 2).and_then(|n| n.to_matrix());
        a.is_ok_and(|a| a.get(0, 0) == 1.0 && a.get(1, 0) == 0.0)
    });

    // Entries and products with arguments of any length.
    for n in [0, 1, 3] {
        t.survives("sparse::Matrix::mul_vec", "x of another length", || {
            a().mul_vec(&vec![1.0; n], &mut [0.0; 2]);
        });
        t.survives("sparse::Matrix::mul_transpose_vec", "y of another length", || {
            a().mul_transpose_vec(&[1.0; 2], &mut vec![0.0; n]);
        });
        t.survives("sparse::Matrix::leading_columns", "any number", || {
            a().leading_columns(n).norm_1()
        });
    }
    for (row, col) in [(2, 0), (0, 2), (MAX, MAX)] {
        t.holds("sparse::Matrix::add", "an entry outside is remembered", || {
            let mut a = a();
            a.add(row, col, 1.0);
            a.stray() == Some((row, col)) && a.get(row, col) == 0.0
        });
        t.holds(
            "sparse::Matrix::add_block",
            "a block outside is remembered",
            || {
                let mut a = a();
                a.add_block(row, col, 1.0, &rows(&[&[1.0, 1.0], &[1.0, 1.0]]));
                a.stray().is_some()
            },
        );
        t.survives("sparse::Pattern::slot", "an entry outside", || {
            a().pattern().slot(row, col)
        });
    }

    let hostile = [
        ("nothing", ""),
        ("another file", "hello"),
        (
            "a header alone",
            "%%MatrixMarket matrix coordinate real general\n",
        ),
        (
            "10^18 entries",
            "%%MatrixMarket matrix coordinate real general\n2 2 1000000000000000000\n1 1 1\n",
        ),
        (
            "10^18 rows",
            "%%MatrixMarket matrix coordinate real general\n2 1000000000000000000 1\n1 1 1\n",
        ),
        (
            "a full matrix of 10^18 entries",
            "%%MatrixMarket matrix array real general\n1000000000 1000000000\n1\n",
        ),
        (
            "more than usize",
            "%%MatrixMarket matrix coordinate real general\n99999999999999999999 1 1\n1 1 1\n",
        ),
        (
            "an overflowing product",
            "%%MatrixMarket matrix array real general\n18446744073709551615 18446744073709551615\n1\n",
        ),
        (
            "index 0",
            "%%MatrixMarket matrix coordinate real general\n1 1 1\n0 1 1\n",
        ),
        (
            "index out of range",
            "%%MatrixMarket matrix coordinate real general\n1 1 1\n2 1 1\n",
        ),
        (
            "too few entries",
            "%%MatrixMarket matrix coordinate real general\n1 1 2\n1 1 1\n",
        ),
        (
            "NaN",
            "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 nan\n",
        ),
        (
            "complex",
            "%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 1\n",
        ),
    ];
    for (input, text) in hostile {
        t.refuses("sparse::parse_matrix_market", input, "line", || {
            parse_matrix_market(text)
        });
    }
    for (input, text) in [
        ("a word", "1\nx\n"),
        ("NaN", "1\nnan\n"),
        ("infinity", "1\ninf\n"),
    ] {
        t.refuses("sparse::parse_vector", input, "line 2", || parse_vector(text));
    }
    substructures(&mut t);
    let missing = Path::new("no/such/file");
    t.refuses("sparse::read_substructure", "no file", "no/such/file", || {
        read_substructure(missing)
    });
    t.refuses("sparse::read_matrix_market", "no file", "no/such/file", || {
        read_matrix_market(missing)
    });
    t.refuses("sparse::read_vector", "no file", "no/such/file", || {
        read_vector(missing)
    });
    t.refuses("sparse::write_matrix_market", "no folder", "no/such/file", || {
        write_matrix_market(missing, &a())
    });
    t.finish();
}

fn substructures(t: &mut Table) {
    let file = |element: &str, labels: &str, lines: &str, entries: &str| {
        format!("**\n{element}\n** ELEMENT NODES\n** {labels}\n{lines}\n*MATRIX, TYPE=STIFFNESS\n{entries}\n")
    };
    let element = "*USER ELEMENT, NODES=2, LINEAR";
    let whole = "4.,\n1., 3.\n.5, .25, 2.";
    assert!(parse_substructure(&file(element, "7, 9", "1, 2\n2, 1", whole)).is_ok());
    for (input, text, word) in [
        ("nothing", String::new(), "USER ELEMENT"),
        (
            "no number of nodes",
            file("*USER ELEMENT, LINEAR", "7, 9", "1", whole),
            "number of nodes",
        ),
        (
            "a label too few",
            file(element, "7", "1, 2\n2, 1", whole),
            "1 labels",
        ),
        (
            "a component 7",
            file(element, "7, 9", "1, 7", whole),
            "component 7",
        ),
        (
            "a node beyond the last",
            file(element, "7, 9", "1, 2\n3, 1", whole),
            "node 3",
        ),
        (
            "nodes out of order",
            file(element, "7, 9", "1, 2\n1, 1", whole),
            "node 1",
        ),
        ("a word", file(element, "7, 9", "1, x", whole), "line 5"),
        (
            "an entry too few",
            file(element, "7, 9", "1, 2\n2, 1", "4., 1., 3., .5, .25"),
            "5 entries",
        ),
        (
            "NaN",
            file(element, "7, 9", "1, 2\n2, 1", "4., 1., 3., nan, .25, 2."),
            "finite",
        ),
        (
            "no stiffness",
            file(element, "7, 9", "1", "").replace("STIFFNESS", "MASS"),
            "no *MATRIX",
        ),
    ] {
        t.refuses("sparse::parse_substructure", input, word, || {
            parse_substructure(&text)
        });
    }
}
