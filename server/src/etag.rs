//! Conditional requests (RFC 9110, section 13): the only place that reads their headers.
//!
//! Handlers set `ETag`; [`condition`] compares it with `If-None-Match` and answers 304. A handler
//! whose answer is costly may ask [`Tags`] first, and answer 304 with its `ETag` itself.

use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;

/// The tags of a condition: those of all lines of its header, each a list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tags {
    /// Whether any tag fits (`*`).
    any: bool,
    /// The text between the quotes. Weak tags count as strong ones: proxies that compress make
    /// ours weak.
    tags: Vec<String>,
}

impl Tags {
    /// The tags in a header; `None` without it.
    pub(crate) fn of(headers: &HeaderMap, name: &HeaderName) -> Option<Self> {
        let mut found = None;
        for line in headers.get_all(name) {
            found.get_or_insert_with(Self::default).add(line.to_str().unwrap_or_default());
        }
        found
    }

    fn add(&mut self, line: &str) {
        let mut rest = line;
        loop {
            rest = rest.trim_start_matches([' ', '\t', ',']);
            let tag = rest.strip_prefix("W/").unwrap_or(rest);
            // A tag without quotes ends with its list element.
            let (tag, end) = match tag.strip_prefix('"') {
                Some(quoted) => (quoted, '"'),
                None => (tag, ','),
            };
            let (tag, after) = tag.split_once(end).unwrap_or((tag, ""));
            rest = after;
            match tag.trim_end() {
                "" if after.is_empty() => return,
                "*" if end == ',' => self.any = true,
                tag => self.tags.push(tag.to_owned()),
            }
        }
    }

    /// Whether a tag, as in `ETag`, is among them.
    pub(crate) fn has(&self, tag: &str) -> bool {
        let tag = tag.trim_start_matches("W/").trim_matches('"');
        self.any || self.tags.iter().any(|known| known == tag)
    }

    /// The tags that are revisions.
    pub(crate) fn revisions(&self) -> impl Iterator<Item = u64> {
        self.tags.iter().filter_map(|tag| tag.parse().ok())
    }
}

/// The tags that a client has, by `If-None-Match`.
pub(crate) fn known(headers: &HeaderMap) -> Tags {
    Tags::of(headers, &header::IF_NONE_MATCH).unwrap_or_default()
}

/// The layer of conditions: an answer whose `ETag` the client has is 304 with the same headers.
pub(crate) async fn condition(request: Request, next: Next) -> Response {
    let is_read = matches!(*request.method(), Method::GET | Method::HEAD);
    let known = Tags::of(request.headers(), &header::IF_NONE_MATCH).filter(|_| is_read);
    let mut response = next.run(request).await;
    let tag = response.headers().get(header::ETAG).and_then(|tag| tag.to_str().ok());
    if response.status() == StatusCode::OK
        && known.zip(tag).is_some_and(|(known, tag)| known.has(tag))
    {
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        *response.body_mut() = Body::empty();
        response.headers_mut().remove(header::CONTENT_TYPE);
        response.headers_mut().remove(header::CONTENT_LENGTH);
    }
    response
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[track_caller]
    fn check(lines: &[&'static str], tag: &str, expected: bool) {
        let mut headers = HeaderMap::new();
        for line in lines {
            headers.append(header::IF_NONE_MATCH, HeaderValue::from_static(line));
        }
        assert_eq!(known(&headers).has(tag), expected, "{lines:?}");
    }

    #[test]
    fn tags_are_found_in_every_form_of_the_header() {
        for lines in [
            &["\"3\""][..],
            &["W/\"3\""],
            &["3"],
            &["\"x\", \"3\""],
            &["\"x\",W/\"3\" ,\"y\""],
            &["\"a,b\",\"3\""],
            &["\"x\"", "\"3\""],
            &[", ,\"3\""],
            &["*"],
            &["\"\", \"3\""],
        ] {
            check(lines, "\"3\"", true);
            check(lines, "W/\"3\"", true);
        }
        for lines in [&[][..], &[""], &["\"x\""], &["\"x,3\""], &["\"*\""], &["\"33\""], &["\"3"]] {
            check(lines, "\"3\"", lines == ["\"3"]);
        }
    }
}
