//! The parts of the dissertation by number: sections, equations, figures, tables, algorithms.

/// A numbered part.
#[derive(Clone, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(super) struct Part {
    kind: Kind,
    /// Its number, with a letter for an appendix: 4.A.
    number: String,
}

#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Kind {
    Section,
    Equation,
    Figure,
    Table,
    Algorithm,
}

impl Part {
    fn new(kind: Kind, number: impl ToString) -> Self {
        Self { kind, number: number.to_string() }
    }

    /// Whether this part is the other, or a section inside it.
    pub(super) fn is_within(&self, other: &Self) -> bool {
        let rest = self.number.strip_prefix(&other.number);
        let is_inside = |rest: &str| rest.starts_with('.') && self.kind == Kind::Section;
        self.kind == other.kind && rest.is_some_and(|rest| rest.is_empty() || is_inside(rest))
    }
}

/// Sections that the dissertation numbers, down to the third level.
const SECTIONS: &str = "1.1 1.2 1.2.1 1.2.2 1.3 1.3.1 1.3.2 1.3.3 1.4 1.4.1 1.4.2 1.4.3 1.4.4 \
    1.4.5 1.4.6 1.5 1.6 2.1 2.1.1 2.2 2.3 2.3.1 2.3.2 2.4 2.4.1 2.4.2 2.4.3 2.5 2.5.1 2.5.2 2.6 \
    2.6.1 2.6.2 2.6.3 3.1 3.1.1 3.2 3.2.1 3.2.2 3.2.3 3.3 3.3.1 3.3.2 3.3.3 3.3.4 3.4 3.4.1 3.4.2 \
    3.5 3.5.1 3.5.2 4.1 4.1.1 4.2 4.2.1 4.2.2 4.3 4.3.1 4.3.2 4.4 4.4.1 4.4.2 4.4.3 4.4.4 4.5 4.A \
    5.1 5.1.1 5.1.2 5.2 5.2.1 5.2.2 5.3 5.3.1 5.3.2 5.3.3 5.3.4 5.3.5 5.3.6 5.4 5.4.1 5.4.2 5.4.3 \
    5.4.4 5.5 5.5.1 5.5.2 5.6 5.6.1 5.6.2 5.6.3 5.6.4 5.6.5 5.6.6 5.6.7 6.1 6.1.1 6.1.2 6.1.3 \
    6.1.4 6.1.5 6.1.6";

/// Every part of the dissertation.
pub(super) fn all() -> Vec<Part> {
    let mut parts: Vec<Part> =
        SECTIONS.split_whitespace().map(|number| Part::new(Kind::Section, number)).collect();
    // The last number in each chapter.
    for (kind, lasts) in [
        (Kind::Equation, [0, 8, 21, 22, 36]),
        (Kind::Figure, [3, 9, 12, 20, 4]),
        (Kind::Table, [0, 1, 1, 0, 0]),
    ] {
        for (chapter, last) in (1..).zip(lasts) {
            parts.extend((1..=last).map(|n| Part::new(kind, format!("{chapter}.{n}"))));
        }
    }
    parts.extend([1, 2].map(|n| Part::new(Kind::Algorithm, n)));
    parts
}

/// The parts that a row's first cell names, such as "3.3.4, eq. 3.14–3.17, table 3.1".
pub(super) fn named(place: &str) -> Vec<Part> {
    let (mut kind, mut parts) = (Kind::Section, Vec::new());
    for word in place.split([' ', ',']).filter(|word| !word.is_empty()) {
        match word.to_lowercase().as_str() {
            "eq." => kind = Kind::Equation,
            "figure" | "figures" => kind = Kind::Figure,
            "table" => kind = Kind::Table,
            "algorithm" => kind = Kind::Algorithm,
            _ if word.starts_with(|c: char| c.is_ascii_digit()) => {
                let (first, last) = word.split_once('–').unwrap_or((word, word));
                parts.extend(range(first, last).into_iter().map(|number| Part::new(kind, number)));
            }
            _ => {}
        }
    }
    parts
}

/// The numbers from one to another that differs in its last component only.
fn range(first: &str, last: &str) -> Vec<String> {
    let split = |number: &str| {
        let (front, back) = number.rsplit_once('.')?;
        Some((front.to_owned(), back.parse::<u32>().ok()?))
    };
    match (split(first), split(last)) {
        (Some((front, from)), Some((same, to))) if front == same => {
            (from..=to).map(|n| format!("{front}.{n}")).collect()
        }
        _ => vec![first.to_owned()],
    }
}

#[test]
fn a_place_names_ranges_and_lists_of_parts() {
    let parts = named("3.3.4, eq. 3.14–3.16, figures 3.1 and 3.2 (a)");
    let numbers: Vec<&str> = parts.iter().map(|part| part.number.as_str()).collect();
    assert_eq!(numbers, ["3.3.4", "3.14", "3.15", "3.16", "3.1", "3.2"]);
    assert!(parts[0].is_within(&Part::new(Kind::Section, "3.3")));
    assert!(!parts[1].is_within(&Part::new(Kind::Equation, "3.1")));
    assert_eq!(named("4.A, algorithm 2").len(), 2);
}
