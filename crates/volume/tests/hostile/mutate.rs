//! Damage to files that is the same in every run.

/// Critical numbers for sizes and offsets.
const EDGES: [u64; 12] =
    [0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x1_0000, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x1_0000_0000, u64::MAX];

/// Words that have a meaning in some header.
const WORDS: [&str; 20] = [
    "-1",
    "0",
    "4294967295",
    "18446744073709551615",
    "1e308",
    "-1e-320",
    "nan",
    "inf",
    "\"",
    "\n\n",
    "<",
    "/>",
    "=",
    "(1,0,0)",
    "[",
    "]]",
    "{",
    "#",
    "\\",
    "\0",
];

/// A xorshift generator.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    /// A number from 0 up to `end`, exclusive; `end` is not 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }
}

/// A file with one to four kinds of damage; pieces may come from `other`.
pub(crate) fn mutant(random: &mut Random, whole: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(4) {
        damage(random, &mut bytes, other);
    }
    bytes
}

fn damage(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let at = random.below(bytes.len() + 1);
    // Headers are damaged more often than samples.
    let at = if random.below(2) == 0 { at.min(random.below(512)) } else { at };
    let room = bytes.len() - at;
    let piece = |random: &mut Random, of: &[u8]| {
        let from = random.below(of.len() + 1);
        let length = random.below((of.len() - from).min(64) + 1);
        of[from..from + length].to_vec()
    };
    match random.below(9) {
        0 if room > 0 => bytes[at] = random.below(256) as u8,
        1 if room > 0 => bytes[at] ^= 1 << random.below(8),
        2 if room > 0 => bytes[at] = b'0' + random.below(10) as u8,
        3 => {
            let size = 1 << random.below(4).min(room.checked_ilog2().unwrap_or(0) as usize);
            if size <= room {
                let edge = EDGES[random.below(EDGES.len())].wrapping_sub(random.below(2) as u64);
                let little_endian = &edge.to_le_bytes()[..size];
                bytes[at..at + size].copy_from_slice(little_endian);
                if random.below(2) == 0 {
                    bytes[at..at + size].reverse();
                }
            }
        }
        4 => {
            let word = WORDS[random.below(WORDS.len())];
            let over = random.below(word.len() + 2).min(room);
            bytes.splice(at..at + over, word.bytes());
        }
        5 => {
            let piece = piece(random, other);
            bytes.splice(at..at + piece.len().min(room), piece);
        }
        6 => {
            let piece = piece(random, bytes);
            bytes.splice(at..at, piece);
        }
        7 => {
            let length = random.below(room.min(64) + 1);
            bytes.drain(at..at + length);
        }
        8 => bytes.truncate(at),
        _ => bytes.push(random.below(256) as u8),
    }
}
