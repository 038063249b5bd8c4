//! The layer below all text formats: any encoding, line end, comment and continuation becomes
//! plain ASCII lines.
//!
//! Geometry is ASCII in every format, so other letters (names, paths) become `?`. Line numbers
//! stay those of the file.

/// A file's text as ASCII, with `\n` at the end of each line and without comments (`#`).
///
/// Reads UTF-8, UTF-16 in both byte orders and any 8-bit encoding, with or without a mark, and the
/// line ends of all systems. A vertex or face of an OBJ that ends with `\` goes on in the next line;
/// names and paths may end so, and do not.
pub(super) fn plain(bytes: &[u8]) -> Vec<u8> {
    let wide = |unit: u16| u8::try_from(unit).unwrap_or(b'?');
    let units = |bytes: &[u8], read: fn([u8; 2]) -> u16| -> Vec<u8> {
        bytes.chunks_exact(2).map(|unit| wide(read([unit[0], unit[1]]))).collect()
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => lines(&units(rest, u16::from_le_bytes)),
        [0xfe, 0xff, rest @ ..] => lines(&units(rest, u16::from_be_bytes)),
        [first, 0, ..] if *first != 0 => lines(&units(bytes, u16::from_le_bytes)),
        [0, second, ..] if *second != 0 => lines(&units(bytes, u16::from_be_bytes)),
        _ => lines(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    }
}

/// The lines of plain text with their numbers from 1, and what is left of it.
pub(super) struct Lines<'a> {
    pub(super) rest: &'a [u8],
    pub(super) line: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn of(text: &'a [u8]) -> Self {
        Self { rest: text, line: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| *byte == b'\n').unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest.get(1..).unwrap_or_default();
        self.line += 1;
        Some((self.line, std::str::from_utf8(line).expect("plain text is ASCII")))
    }
}

/// The next `N` words as numbers.
pub(super) fn numbers<'a, const N: usize>(
    words: &mut impl Iterator<Item = &'a str>,
) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    Some(numbers)
}

fn lines(bytes: &[u8]) -> Vec<u8> {
    let mut text = Vec::with_capacity(bytes.len() + 1);
    let (mut begin, mut joined, mut is_comment, mut before) = (0, 0, false, 0);
    for &byte in bytes {
        match byte {
            b'\n' if before == b'\r' => {}
            b'\r' | b'\n' => {
                if end_line(&mut text, begin) {
                    joined += 1;
                } else {
                    text.resize(text.len() + joined + 1, b'\n');
                    (begin, joined) = (text.len(), 0);
                }
                is_comment = false;
            }
            b'#' => is_comment = true,
            _ if is_comment => {}
            _ => text.push(if byte.is_ascii() { byte } else { b'?' }),
        }
        before = byte;
    }
    end_line(&mut text, begin);
    text
}

/// Drops blanks at a line's end; true if the line goes on in the next one.
fn end_line(text: &mut Vec<u8>, begin: usize) -> bool {
    while text.len() > begin && text.last().is_some_and(u8::is_ascii_whitespace) {
        text.pop();
    }
    let line = text[begin..].trim_ascii_start();
    let goes_on =
        line.ends_with(b"\\") && matches!(line, [b'v' | b'V' | b'f' | b'F', b' ' | b'\t', ..]);
    if goes_on {
        text.pop();
        text.push(b' ');
    }
    goes_on
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_writing_of_a_text_becomes_the_same_lines() {
        let text = "v 1\nf 2 3\n\ng b\n";
        let wide = |read: fn(u16) -> [u8; 2], mark: bool| -> Vec<u8> {
            let mark = if mark { "\u{feff}" } else { "" };
            format!("{mark}{text}").encode_utf16().flat_map(read).collect()
        };
        let writings: [Vec<u8>; 9] = [
            text.into(),
            text.replace('\n', "\r\n").into(),
            text.replace('\n', "\r").into(),
            format!("\u{feff}{text}").into(),
            wide(u16::to_le_bytes, true),
            wide(u16::to_be_bytes, true),
            wide(u16::to_le_bytes, false),
            wide(u16::to_be_bytes, false),
            "v 1 # one\nf \\\n2 3 \ng b\n".into(),
        ];
        for writing in writings {
            let words = |text: &[u8]| {
                let text = String::from_utf8(text.to_vec()).unwrap();
                text.split('\n')
                    .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
                    .collect::<Vec<_>>()
            };
            assert_eq!(words(&plain(&writing)), words(text.as_bytes()));
        }
    }

    #[test]
    fn paths_that_end_with_a_backslash_end() {
        assert_eq!(plain(b"comment C:\\parts\\\nf 1\\\n2\n"), b"comment C:\\parts\\\nf 1 2\n\n");
        assert_eq!(plain(b"g Geh\xe4use"), b"g Geh?use");
    }
}
