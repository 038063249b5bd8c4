//! The API's operations as a plain page, for `/docs` in a build without the feature `swagger`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::OnceLock;

use super::{document, operations};

const HEAD: &str = "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">\
    <title>Palpate's API</title>\n<h1>Palpate's API</h1>\n\
    <p>The full description is <a href=\"/openapi.json\">openapi.json</a> (OpenAPI 3.1). A server \
    built with <code>--features swagger</code> shows Swagger UI here.</p>\n";

/// The page: a table of operations for each tag, in the order of their paths.
pub(crate) fn page() -> &'static str {
    static PAGE: OnceLock<String> = OnceLock::new();
    PAGE.get_or_init(written)
}

fn written() -> String {
    let mut document = document();
    let mut rows: BTreeMap<String, String> = BTreeMap::new();
    for (path, item) in &mut document.paths.paths {
        for (method, operation) in operations(item) {
            let tag = operation.tags.iter().flatten().next().cloned().unwrap_or_default();
            let summary = operation.summary.as_deref().unwrap_or_default();
            let rows = rows.entry(tag).or_default();
            let _ = writeln!(
                rows,
                "<tr><td>{method}<td><code>{}</code><td>{}",
                escaped(path),
                escaped(summary)
            );
        }
    }
    rows.into_iter().fold(HEAD.to_owned(), |mut page, (tag, rows)| {
        let _ = write!(page, "<h2>{}</h2>\n<table>\n{rows}</table>\n", escaped(&tag));
        page
    })
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_lists_every_operation_once() {
        let n_operations: usize =
            document().paths.paths.values_mut().map(|item| operations(item).count()).sum();
        let rows: Vec<&str> = page().lines().filter(|line| line.starts_with("<tr>")).collect();
        assert_eq!(rows.len(), n_operations);
        assert!(
            rows.contains(&"<tr><td>GET<td><code>/livez</code><td>Check that the process answers"),
            "{}",
            page()
        );
        assert!(page().contains("<h2>sessions</h2>") && page().contains("/openapi.json"));
    }

    #[test]
    fn text_of_the_description_is_no_markup() {
        assert_eq!(escaped("a < b && c > d"), "a &lt; b &amp;&amp; c &gt; d");
    }
}
