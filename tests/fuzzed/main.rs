//! The invariants of the fuzz targets under random bytes. What fuzzing has found is tested next to the code concerned.

mod oracles;

use proptest::collection::vec;
use proptest::prelude::*;

/// Bytes of which few encode huge, infinite or NaN numbers, so that most problems are ordinary.
fn bytes(longest: usize) -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![9 => any::<u8>(), 1 => Just(127_u8)], 0..longest)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn mcps(data in bytes(80)) {
        oracles::mcp(&data);
    }

    #[test]
    fn friction_problems(data in bytes(90)) {
        oracles::friction(&data);
    }

    /// Lines of valid words in a wrong order.
    #[test]
    fn files(words in vec(prop_oneof![
        Just("$MeshFormat\n"), Just("4.1 0 8\n"), Just("2.2 0 8\n"), Just("$EndMeshFormat\n"), Just("$Nodes\n"),
        Just("$EndNodes\n"), Just("$Elements\n"), Just("$EndElements\n"), Just("$PhysicalNames\n"), Just("1 "), Just("2 "),
        Just("3 "), Just("0.5 "), Just("-1 "), Just("1e300 "), Just("nan "), Just("18446744073709551615 "), Just("\n"),
        Just("%%MatrixMarket matrix coordinate real general\n"), Just("%%MatrixMarket matrix array real symmetric\n"),
        Just("BEGIN POINTS LIST\n"), Just("END POINTS LIST\n"), Just("POINT 0 "), Just("BEGIN MESH STRUCTURE DESCRIPTION\n"),
        Just("CONVEX 0 'GT_PK(2,1)' "),
    ], 0..60)) {
        oracles::readers(words.concat().as_bytes());
    }
}
