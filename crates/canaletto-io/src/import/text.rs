//! A text in pieces of whole lines, which are parsed in parallel.
//!
//! The boundary of a piece depends only on the bytes around it: the first certain line end after a multiple of the
//! piece size. Lines that a backslash joins stay together, whatever precedes them.

use super::lines::{BLANKS, ImportError, goes_on};
use super::unreadable;
use crate::content::View;
use canaletto_parallel::prelude::*;
use std::ops::Range;

/// A text and the size of its pieces.
#[derive(Clone, Copy)]
pub(super) struct Text<'a> {
    pub(super) view: View<'a>,
    /// The approximate number of bytes per piece.
    pub(super) size: usize,
}

/// Whole lines and their offset in the text.
#[derive(Clone, Copy)]
pub(super) struct Piece<'a> {
    pub(super) start: usize,
    pub(super) bytes: &'a [u8],
}

impl<'a> Text<'a> {
    /// A text in pieces that fit in the cache of a core.
    pub(super) fn new(view: View<'a>) -> Text<'a> {
        Text { view, size: 1 << 18 }
    }

    /// The number of pieces.
    pub(super) fn len(self) -> usize {
        self.view.size().div_ceil(self.size)
    }

    /// Reads some of the pieces and passes the results of `work` on in order. Only a few are in progress at a time.
    pub(super) fn each<T: Send>(
        self,
        pieces: &[usize],
        work: impl Fn(usize, Piece<'_>) -> T + Sync,
        mut take: impl FnMut(usize, T) -> Result<(), ImportError>,
    ) -> Result<(), ImportError> {
        for some in pieces.chunks(16 * rayon::current_num_threads()) {
            let results: Vec<Result<T, ImportError>> = some
                .par_iter()
                .map_init(Vec::new, |buffer, &index| self.piece(index, buffer).map(|piece| work(index, piece)))
                .collect();
            for (&index, result) in some.iter().zip(results) {
                take(index, result?)?;
            }
        }
        Ok(())
    }

    /// A piece; it may be empty.
    fn piece<'b>(self, index: usize, buffer: &'b mut Vec<u8>) -> Result<Piece<'b>, ImportError>
    where
        'a: 'b,
    {
        let size = self.view.size();
        let (from, to) = (index * self.size, ((index + 1) * self.size).min(size));
        let mut more = 1 << 12;
        let base = from.saturating_sub(1 + BLANKS);
        let lines = loop {
            // Most lines are short.
            let range = base..to.saturating_add(more).min(size);
            let whole = range.end == size;
            let bytes = self.view.piece(range, buffer).map_err(|e| unreadable(&e))?;
            let start = if index == 0 { Some(0) } else { line_end(bytes, from - base..to - base) };
            let end = start.and_then(|_| line_end(bytes, to - base..bytes.len()));
            match (start, end) {
                (None, _) => break 0..0,
                (Some(start), Some(end)) => break start..end,
                (Some(start), None) if whole => break start..bytes.len(),
                _ => more = more.saturating_mul(4),
            }
        };
        let bytes = match self.view {
            View::Memory(bytes) => &bytes[base..],
            View::File(..) => buffer,
        };
        Ok(Piece { start: base + lines.start, bytes: &bytes[lines] })
    }
}

/// The first certain line end in a range.
fn line_end(bytes: &[u8], range: Range<usize>) -> Option<usize> {
    let start = range.start;
    memchr::memchr2_iter(b'\n', b'\r', &bytes[range])
        .map(|at| start + at)
        .find(|&at| at > 0 && !matches!(bytes[at - 1], b'\n' | b'\r') && !goes_on(&bytes[..at]))
}

#[cfg(test)]
mod tests {
    use super::super::lines::Lines;
    use super::*;
    use proptest::prelude::*;

    proptest! {

        #![proptest_config(crate::testing::seeded())]

        #[test]
        fn pieces_are_whole_lines(text in "[ab#\\t\\\\\n\r ]{0,60}", size in 1usize..20) {
            let bytes = text.as_bytes();
            let said = |lines: Lines<'_>| lines.joined().map(|line| (line.start, line.text.to_vec())).collect::<Vec<_>>();
            let pieces = Text { view: bytes.into(), size };
            let (mut found, mut end) = (Vec::new(), 0);
            for index in 0..pieces.len() {
                let mut buffer = Vec::new();
                let piece = pieces.piece(index, &mut buffer).unwrap();
                if !piece.bytes.is_empty() {
                    prop_assert_eq!(piece.start, end);
                    end += piece.bytes.len();
                }
                found.extend(said(Lines::of_piece(piece)));
            }
            prop_assert_eq!(end, bytes.len());
            prop_assert_eq!(found, said(Lines::new(bytes, 0)));
        }
    }
}
