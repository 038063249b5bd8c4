//! A request before it is sent: method, path, query, content, and whether it may be repeated.

use bytes::Bytes;
use palpate_schemas::{LabelledQuery, PageQuery};
use reqwest::{Method, Url};
use serde::Serialize;

use crate::retry::Repeat;

/// Content of a request.
#[derive(Clone, Debug)]
pub(crate) enum Content {
    Nothing,
    Json(Bytes),
    Raw { media_type: &'static str, bytes: Bytes },
}

/// A request that can be sent repeatedly.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) method: Method,
    pub(crate) path: Vec<String>,
    pub(crate) query: Vec<(&'static str, String)>,
    pub(crate) headers: Vec<(&'static str, String)>,
    pub(crate) content: Content,
    pub(crate) repeat: Repeat,
}

impl Request {
    pub(crate) fn get<'p>(path: impl IntoIterator<Item = &'p str>) -> Self {
        Self::new(Method::GET, path, Repeat::Harmless)
    }

    /// A request that sets the whole state, so repeating it is harmless.
    pub(crate) fn put<'p>(path: impl IntoIterator<Item = &'p str>) -> Self {
        Self::new(Method::PUT, path, Repeat::Harmless)
    }

    pub(crate) fn post<'p>(path: impl IntoIterator<Item = &'p str>) -> Self {
        Self::new(Method::POST, path, Repeat::Harmful)
    }

    /// A request that sets fields, so repeating it is harmless.
    pub(crate) fn patch<'p>(path: impl IntoIterator<Item = &'p str>) -> Self {
        Self::new(Method::PATCH, path, Repeat::Harmless)
    }

    /// A request not repeated after an unknown outcome: the second answer would be "not found".
    pub(crate) fn delete<'p>(path: impl IntoIterator<Item = &'p str>) -> Self {
        Self::new(Method::DELETE, path, Repeat::Harmful)
    }

    fn new<'p>(method: Method, path: impl IntoIterator<Item = &'p str>, repeat: Repeat) -> Self {
        let path = path.into_iter().map(str::to_owned).collect();
        let (query, headers, content) = (Vec::new(), Vec::new(), Content::Nothing);
        Self { method, path, query, headers, content, repeat }
    }

    pub(crate) fn page(self, page: &PageQuery) -> Self {
        self.query("limit", page.limit).query("cursor", page.cursor.as_deref())
    }

    pub(crate) fn labelled(self, query: &LabelledQuery) -> Self {
        let page = PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        self.page(&page).query("labels", query.labels.as_ref())
    }

    pub(crate) fn query(mut self, name: &'static str, value: Option<impl ToString>) -> Self {
        self.query.extend(value.map(|value| (name, value.to_string())));
        self
    }

    pub(crate) fn header(mut self, name: &'static str, value: String) -> Self {
        self.headers.push((name, value));
        self
    }

    pub(crate) fn json(mut self, body: &impl Serialize) -> Self {
        let json = serde_json::to_vec(body).expect("wire types have string keys only");
        self.content = Content::Json(json.into());
        self
    }

    pub(crate) fn raw(mut self, media_type: &'static str, bytes: Bytes) -> Self {
        self.content = Content::Raw { media_type, bytes };
        self
    }

    pub(crate) fn repeat(mut self, repeat: Repeat) -> Self {
        self.repeat = repeat;
        self
    }

    /// URL of the request, with escaped names.
    pub(crate) fn url(&self, server: &Url) -> Url {
        let mut url = server.clone();
        url.path_segments_mut()
            .expect("an http address has a path")
            .pop_if_empty()
            .extend(&self.path);
        if !self.query.is_empty() {
            url.query_pairs_mut().extend_pairs(&self.query);
        }
        url
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_paths_and_queries_are_escaped() {
        let request = Request::get(["v1", "objects", "a/b ü"]).query("cursor", Some("x&y"));
        let url = request.query("limit", None::<u32>).url(&Url::parse("http://h:1/p/").unwrap());
        assert_eq!(url.as_str(), "http://h:1/p/v1/objects/a%2Fb%20%C3%BC?cursor=x%26y");
    }
}
