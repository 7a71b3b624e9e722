use crate::words::named;

/// State of a contact node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ContactState {
    /// λ_ν = λ_t = 0.
    Open,
    /// u_ν = gap, u_t = 0.
    Stick,
    /// u_ν = gap, λ_t = F λ_ν, u_t ≥ 0.
    SlipPlus,
    /// u_ν = gap, λ_t = −F λ_ν, u_t ≤ 0.
    SlipMinus,
}

impl ContactState {
    /// All states, in the order of the pieces.
    pub const ALL: [Self; 4] = [Self::Open, Self::Stick, Self::SlipPlus, Self::SlipMinus];

    /// The state in words: "open", "stick", "slip+", "slip-".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Stick => "stick",
            Self::SlipPlus => "slip+",
            Self::SlipMinus => "slip-",
        }
    }

    /// The state as one letter: O, K, +, −.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Self::Open => 'O',
            Self::Stick => 'K',
            Self::SlipPlus => '+',
            Self::SlipMinus => '-',
        }
    }

    /// Whether the node slips, to whichever side.
    #[must_use]
    pub const fn is_slip(self) -> bool {
        matches!(self, Self::SlipPlus | Self::SlipMinus)
    }

    /// Slip under the force `traction` along t₁: slip− if that is negative, slip+ otherwise.
    #[must_use]
    pub fn slipping(traction: f64) -> Self {
        if traction < 0.0 {
            Self::SlipMinus
        } else {
            Self::SlipPlus
        }
    }

    /// Number of the piece of this state.
    #[must_use]
    pub const fn piece(self) -> usize {
        self as usize
    }
}

named!(ContactState, "state of a contact node", Self::ALL);
