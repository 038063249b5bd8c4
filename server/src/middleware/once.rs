//! Header fields that come once, and the host that a request addresses.
//!
//! When a field comes twice, one program reads the first and another the last, so a proxy may have
//! checked another request than the one that is answered. Such a request is refused (RFC 9110,
//! section 5.3; for `Host` also RFC 9112, section 3.2).

use axum::extract::Request;
use axum::http::uri::Authority;
use axum::http::{HeaderName, Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::middleware::telemetry::REQUEST_ID;
use crate::refusal::{Refusal, RequestError};

/// The fields that the server reads and that are no lists.
const ONCE: [HeaderName; 9] = [
    header::HOST,
    header::AUTHORIZATION,
    header::ORIGIN,
    header::CONTENT_TYPE,
    header::CONTENT_LENGTH,
    header::CONTENT_ENCODING,
    HeaderName::from_static("last-event-id"),
    HeaderName::from_static("traceparent"),
    REQUEST_ID,
];

/// The host that a request addresses, with its port; empty in HTTP/1.0 without one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Host(pub(crate) String);

/// Refuses a request with a repeated field, or without one valid host.
pub(crate) async fn check(mut request: Request, next: Next) -> Response {
    match host(&request) {
        Ok(host) => {
            request.extensions_mut().insert(host);
            next.run(request).await
        }
        Err(error) => Refusal::from(error).into_response(),
    }
}

fn host(request: &Request) -> Result<Host, RequestError> {
    let headers = request.headers();
    for name in ONCE {
        let found = headers.get_all(&name).iter().count();
        if found > 1 {
            return Err(RequestError::Repeated { name, found });
        }
    }
    let target = request.uri().authority();
    let Some(host) = headers.get(header::HOST) else {
        if request.version() >= Version::HTTP_11 {
            return Err(RequestError::Host { found: String::new() });
        }
        return Ok(Host(target.map(ToString::to_string).unwrap_or_default()));
    };
    let wrong = || RequestError::Host { found: String::from_utf8_lossy(host.as_bytes()).into() };
    let text = host.to_str().map_err(|_| wrong())?;
    let parsed: Authority = text.parse().map_err(|_| wrong())?;
    let is_port = text.strip_prefix(parsed.host()).is_some_and(|port| {
        port.is_empty() || port.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok())
    });
    if !is_port || parsed.host().is_empty() || target.is_some_and(|target| *target != parsed) {
        return Err(wrong());
    }
    Ok(Host(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use axum::body::Body;

    use super::*;

    fn asked(version: Version, target: &str, lines: &[(HeaderName, &str)]) -> Option<String> {
        let request = Request::builder().version(version).uri(target);
        let request =
            lines.iter().fold(request, |request, (name, line)| request.header(name, *line));
        host(&request.body(Body::empty()).unwrap()).ok().map(|Host(host)| host)
    }

    #[test]
    fn one_valid_host_is_needed() {
        let with = |lines: &[&str]| {
            let lines: Vec<_> = lines.iter().map(|line| (header::HOST, *line)).collect();
            asked(Version::HTTP_11, "/livez", &lines)
        };
        for fine in ["localhost", "127.0.0.1:7411", "[::1]:7411", "[::1]", "Palpate.Lab:80"] {
            assert_eq!(with(&[fine]).as_deref(), Some(fine));
            assert_eq!(with(&[fine, fine]), None, "twice");
        }
        for wrong in ["", " ", "a b", "u@localhost", "localhost:99999", "localhost:x", "a/b", ":80"]
        {
            assert_eq!(with(&[wrong]), None, "{wrong:?}");
        }
        assert_eq!(with(&[]), None);
        assert_eq!(asked(Version::HTTP_10, "/livez", &[]).as_deref(), Some(""));
        let lines = [(header::HOST, "localhost")];
        assert_eq!(asked(Version::HTTP_11, "http://evil.example/", &lines), None);
        let same = asked(Version::HTTP_11, "http://LOCALHOST/", &lines);
        assert_eq!(same.as_deref(), Some("localhost"));
    }

    #[test]
    fn no_field_of_the_list_comes_twice() {
        for name in ONCE {
            let host = (header::HOST, "localhost");
            let [a, b] = ["1", "2"].map(|line| (name.clone(), line));
            assert_eq!(asked(Version::HTTP_11, "/", &[host, a, b]), None, "{name}");
        }
    }
}
