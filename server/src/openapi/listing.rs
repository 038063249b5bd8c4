//! The API's operations as a page, for `/docs` in a build without the feature `swagger`: an index,
//! and for each operation its method, path and summary.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::OnceLock;

use super::{document, operations};

/// Dressed in the dashboard's styles, as the page that Swagger UI is in.
const HEAD: &str = r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>API · Palpate</title>
<link rel="icon" href="/assets/icon.svg">
<link rel="stylesheet" href="/assets/app.css">
</head>
<body>
<header class="top">
<a class="brand" href="/"><img src="/assets/icon.svg" width="26" height="26" alt=""><span>Palpate</span></a>
<nav aria-label="Pages"><ul><li><a href="/">Dashboard</a></li><li><a href="/docs/" aria-current="page">API</a></li></ul></nav>
</header>
<main class="operations">
<div class="view-head"><div><h1>API</h1>
<p class="sub">All operations; requests, answers and examples are in <a href="/openapi.json">openapi.json</a> (OpenAPI 3.1).
A server built with <code>--features swagger</code> shows them here, to be tried.</p></div></div>
"#;

/// The page: an index of the tags, and a table of operations for each, in the order of their paths.
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
            let id = operation.operation_id.as_deref().unwrap_or_default();
            let _ = writeln!(
                rows.entry(tag).or_default(),
                "<tr id=\"{id}\"><td><a href=\"#{id}\">{method}</a></td><th scope=\"row\"><code>{}</code></th>\
                 <td>{}</td></tr>",
                escaped(path),
                escaped(summary)
            );
        }
    }
    let mut page =
        format!("{HEAD}<nav class=\"panel\" aria-label=\"Groups\"><ul class=\"layers\">");
    for tag in rows.keys() {
        let _ = write!(page, "<li><a href=\"#{0}\">{0}</a></li>", escaped(tag));
    }
    page.push_str("</ul></nav>\n");
    for (tag, rows) in rows {
        let tag = escaped(&tag);
        let _ = write!(
            page,
            "<section class=\"panel\" id=\"{tag}\"><header class=\"panel-head\"><h2>{tag}</h2></header>\n\
             <div class=\"scroll\"><table>\n<tbody>\n{rows}</tbody></table></div></section>\n"
        );
    }
    page + "</main>\n</body>\n</html>\n"
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
        let rows: Vec<&str> = page().lines().filter(|line| line.starts_with("<tr")).collect();
        assert_eq!(rows.len(), n_operations);
        let one = "<tr id=\"livez\"><td><a href=\"#livez\">GET</a></td>\
                   <th scope=\"row\"><code>/livez</code></th>\
                   <td>Check that the process answers</td></tr>";
        assert!(rows.contains(&one), "{}", page());
        let no_summary = rows.iter().find(|row| row.ends_with("<td></td></tr>"));
        assert_eq!(no_summary, None, "every operation says what it does");
    }

    #[test]
    fn the_page_leads_back_and_every_anchor_has_its_target() {
        let page = page();
        assert!(page.contains("href=\"/\">Dashboard</a>") && page.contains("/assets/app.css"));
        let targets = page.split("href=\"#").skip(1).map(|rest| &rest[..rest.find('"').unwrap()]);
        for target in targets {
            assert!(page.contains(&format!("id=\"{target}\"")), "#{target} leads nowhere");
        }
        assert!(page.contains("id=\"sessions\"") && page.contains("/openapi.json"));
    }

    #[test]
    fn text_of_the_description_is_no_markup() {
        assert_eq!(escaped("a < b && c > d"), "a &lt; b &amp;&amp; c &gt; d");
    }
}
