//! Words of single bits: each bit once, with its name, its number and what people read while it is
//! set.

/// Declares the bits of a word. Where each has words, `words` gives those of the bits that are set.
macro_rules! bits {
    ($($(#[$doc:meta])* $name:ident = $bit:literal;)*) => {
        $($(#[$doc])* pub const $name: u16 = 1 << $bit;)*

        /// The names of the bits in their order, from bit 0 on.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];
    };
    ($($(#[$doc:meta])* $name:ident = $bit:literal, $words:literal;)*) => {
        bits! { $($(#[$doc])* $name = $bit;)* }

        /// The words of the bits that are set.
        pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
            let all = [$(($name, $words)),*].into_iter();
            all.filter(move |(bit, _)| bits & bit != 0).map(|(_, words)| words)
        }
    };
}
