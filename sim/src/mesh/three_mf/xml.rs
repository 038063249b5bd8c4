//! The elements of an XML part, and their attributes. What one element, text or comment may take is
//! bounded, since the XML reader holds each as a whole.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Read};

use glam::DAffine3;
use quick_xml::events::{BytesStart, Event};

use super::part;
use crate::mesh::MeshError;

/// Most bytes of one element, text or comment.
const EVENT_BYTES_MAX: usize = 1_000_000;

/// Calls `see` with each element of the part `name`, in order.
pub(super) fn each_element(
    name: &str,
    xml: impl BufRead,
    mut see: impl FnMut(&BytesStart<'_>) -> Result<(), MeshError>,
) -> Result<(), MeshError> {
    let mut reader = quick_xml::Reader::from_reader(Bounded { xml, left: 0 });
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        reader.get_mut().left = EVENT_BYTES_MAX;
        let event = match reader.read_event_into(&mut buffer) {
            Ok(event) => event,
            Err(_) if reader.get_ref().left == 0 => {
                return Err(part(name, "elements, texts and comments of at most 1 MB"));
            }
            Err(_) => return Err(part(name, "well-formed XML, at most 256 MB of it")),
        };
        match event {
            Event::Start(element) | Event::Empty(element) => see(&element)?,
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

/// A reader that fails after a number of bytes.
struct Bounded<R> {
    xml: R,
    left: usize,
}

impl<R: BufRead> Read for Bounded<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(into)?;
        self.consume(n);
        Ok(n)
    }
}

impl<R: BufRead> BufRead for Bounded<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.left == 0 {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let bytes = self.xml.fill_buf()?;
        Ok(&bytes[..bytes.len().min(self.left)])
    }

    fn consume(&mut self, n: usize) {
        self.left -= n;
        self.xml.consume(n);
    }
}

/// The value of the attribute with this local name, under any prefix.
pub(super) fn text(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let mut attributes = element.attributes();
    let found = attributes
        .with_checks(false)
        .flatten()
        .find(|attribute| attribute.key.local_name().as_ref() == name)?;
    Some(found.value.into_owned())
}

/// All attributes by their local names.
pub(super) fn attributes(element: &BytesStart<'_>) -> BTreeMap<String, String> {
    let mut attributes = element.attributes();
    let named = attributes.with_checks(false).flatten().map(|attribute| {
        (attribute.key.local_name().as_ref().to_owned(), attribute.value.into_owned())
    });
    named.collect()
}

/// A transform of twelve numbers, row by row for points that are rows.
pub(super) fn transform(text: &str) -> Option<DAffine3> {
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let numbers: [f64; 12] = numbers.try_into().ok()?;
    Some(DAffine3::from_cols_array(&numbers))
}
