//! What the server sends by itself: streams of server-sent events, described by one of their
//! events, and posts to webhooks.
//!
//! The fields of an event are texts, and `data` holds a JSON document. OpenAPI 3.2 calls this
//! schema `itemSchema`; readers of 3.1 look for it in `schema`.

use utoipa::openapi::path::{HttpMethod, Operation, OperationBuilder, PathItem, PathsBuilder};
use utoipa::openapi::request_body::RequestBodyBuilder;
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::{Content, Paths, Ref, RefOr, Required, Response};

/// The content type of a stream.
const CONTENT_TYPE: &str = "text/event-stream";

/// Describes the events of an operation that answers with a stream.
pub(super) fn describe_stream(operation: &mut Operation) {
    let (names, data) = match operation.operation_id.as_deref() {
        Some("job_events") => (&["job"][..], "Job"),
        _ => (&["belief", "closed", "deleted"][..], "SessionEvent"),
    };
    for response in operation.responses.responses.values_mut() {
        let RefOr::T(response) = response else { continue };
        if let Some(RefOr::T(content)) = response.content.get_mut(CONTENT_TYPE) {
            content.schema = Some(event(names, data).build().into());
        }
    }
}

fn event(names: &'static [&'static str], data: &str) -> ObjectBuilder {
    let text = || ObjectBuilder::new().schema_type(Type::String);
    let name = text().enum_values(Some(names.iter().copied()));
    let id = text().description(Some("The belief's revision, for `Last-Event-ID`."));
    let mut content = text()
        .content_media_type("application/json")
        .description(Some(format!("A `{data}` as JSON.")))
        .build();
    content.content_schema = Some(Box::new(Ref::from_schema_name(data).into()));
    ObjectBuilder::new()
        .schema_type(Type::Object)
        .description(Some("One event of the stream."))
        .property("event", name)
        .property("id", id)
        .property("data", content)
        .required("event")
        .required("data")
}

/// The posts to webhooks.
pub(super) fn webhooks() -> Paths {
    let event = Content::new(Some(Ref::from_schema_name("WebhookEvent")));
    let body = RequestBodyBuilder::new().content("application/json", event);
    let mut post = OperationBuilder::new()
        .tag("webhooks")
        .operation_id(Some("receive_webhook_event"))
        .summary(Some("Receive an event"))
        .description(Some(
            "Posted to the URL of a webhook, signed as Standard Webhooks say. After any other \
             answer the server sends the event again.",
        ))
        .request_body(Some(body.required(Some(Required::True)).build()))
        .response("2XX", Response::new("The event has arrived"))
        .response("410", Response::new("No more events are wanted: the webhook is disabled"))
        .build();
    post.security = Some(Vec::new());
    PathsBuilder::new().path("event", PathItem::new(HttpMethod::Post, post)).build()
}
