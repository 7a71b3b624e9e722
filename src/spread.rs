//! Quasi-random and pseudo-random numbers, the same on every machine.

/// The fractional parts of k/φ, k = 1, 2, …, which fill (0, 1) evenly (φ the golden ratio).
pub(crate) fn golden(k: usize) -> f64 {
    (k as f64 * 0.618_033_988_749_895).fract()
}

/// Term k of one of two sequences in (−½, ½) without a common pattern: fractional parts of multiples of 1/φ and of √2, less ½.
pub(crate) fn centred(k: usize, second: bool) -> f64 {
    let step = if second {
        std::f64::consts::SQRT_2
    } else {
        0.618_033_988_749_895
    };
    (step * k as f64).fract() - 0.5
}

/// A sequence of random numbers that is the same every time: xorshift64* (Vigna 2016).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        // 0 would stay 0; neighbouring seeds are spread by an odd factor.
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Uniform in [−1, 1).
    pub(crate) fn symmetric(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A random error in units of the least one that is assumed: of either sign, and of a size between one and two, since errors of one
    /// size cancel one another exactly where terms are equal.
    pub(crate) fn error(&mut self) -> f64 {
        let random = self.symmetric();
        random + 1.0_f64.copysign(random)
    }

    /// Uniform in 0..n; 0 for n = 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((self.next() >> 33) as usize) % n.max(1)
    }
}
