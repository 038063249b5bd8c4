//! `/v1/webhooks`: receivers of signed events, and the history of deliveries to them.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::Response;
use palpate_schemas::{
    CreateWebhook, NewWebhook, PageQuery, RotateWebhookSecret, UpdateWebhook, Webhook,
    WebhookDelivery, WebhookDeliveryPage, WebhookPage,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Deleted};

/// List the webhooks
///
/// Pages of webhooks, without their secrets.
#[utoipa::path(get, path = "/v1/webhooks", operation_id = "list_webhooks", tag = "webhooks",
    params(PageQuery),
    responses((status = 200, description = "A page of webhooks, oldest first", body = WebhookPage)))]
pub(crate) async fn list_webhooks(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<WebhookPage>, Refusal> {
    Ok(Json(app.webhooks.list(&query)?))
}

/// Create a webhook
///
/// Posts a `WebhookEvent` to the URL for every event from now on, signed as Standard Webhooks
/// describes. Returns the secret, once. A failed delivery is attempted again after 5 s, 30 s,
/// 2 min, 10 min, 1 h, 6 h and 24 h. 409 if there are 32 webhooks.
#[utoipa::path(post, path = "/v1/webhooks", operation_id = "create_webhook", tag = "webhooks",
    request_body = CreateWebhook,
    responses((status = 201, description = "The new webhook and its secret", body = NewWebhook),
        Conflict))]
pub(crate) async fn create_webhook(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateWebhook>,
) -> Result<Response, Refusal> {
    let created = app.webhooks.create(&request).await?;
    Ok(super::created(format!("/v1/webhooks/{}", created.webhook.id), created))
}

/// Get a webhook
///
/// URL, events and state of a webhook, without its secret.
#[utoipa::path(get, path = "/v1/webhooks/{webhook}", operation_id = "get_webhook",
    tag = "webhooks", params(("webhook" = Uuid, Path, description = "The webhook's id")),
    responses((status = 200, description = "The webhook", body = Webhook)))]
pub(crate) async fn get_webhook(
    State(app): State<App>,
    Segments(webhook): Segments,
) -> Result<Json<Webhook>, Refusal> {
    Ok(Json(app.webhooks.get(&webhook)?))
}

/// Change a webhook
///
/// Changes its URL, events or description, disables it or enables it again.
#[utoipa::path(patch, path = "/v1/webhooks/{webhook}", operation_id = "update_webhook",
    tag = "webhooks", request_body = UpdateWebhook,
    params(("webhook" = Uuid, Path, description = "The webhook's id")),
    responses((status = 200, description = "The changed webhook", body = Webhook)))]
pub(crate) async fn update_webhook(
    State(app): State<App>,
    Segments(webhook): Segments,
    JsonBody(request): JsonBody<UpdateWebhook>,
) -> Result<Json<Webhook>, Refusal> {
    Ok(Json(app.webhooks.update(&webhook, &request).await?))
}

/// Delete a webhook
///
/// Also deletes its history. Deliveries that wait are not made.
#[utoipa::path(delete, path = "/v1/webhooks/{webhook}", operation_id = "delete_webhook",
    tag = "webhooks", params(("webhook" = Uuid, Path, description = "The webhook's id")),
    responses(Deleted))]
pub(crate) async fn delete_webhook(
    State(app): State<App>,
    Segments(webhook): Segments,
) -> Result<StatusCode, Refusal> {
    app.webhooks.delete(&webhook).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Rotate a webhook's secret
///
/// Returns the new secret, once. For `grace_s` seconds messages have a signature by each of both
/// secrets.
#[utoipa::path(post, path = "/v1/webhooks/{webhook}/rotate",
    operation_id = "rotate_webhook_secret", tag = "webhooks", request_body = RotateWebhookSecret,
    params(("webhook" = Uuid, Path, description = "The webhook's id")),
    responses((status = 200, description = "The webhook and its new secret", body = NewWebhook)))]
pub(crate) async fn rotate_webhook_secret(
    State(app): State<App>,
    Segments(webhook): Segments,
    JsonBody(request): JsonBody<RotateWebhookSecret>,
) -> Result<Json<NewWebhook>, Refusal> {
    Ok(Json(app.webhooks.rotate(&webhook, &request).await?))
}

/// Send a test message
///
/// Posts an event of type `ping` once, and returns the delivery with the outcome. 409 if the webhook
/// is disabled.
#[utoipa::path(post, path = "/v1/webhooks/{webhook}/test", operation_id = "test_webhook",
    tag = "webhooks", params(("webhook" = Uuid, Path, description = "The webhook's id")),
    responses((status = 200, description = "The delivery of the message", body = WebhookDelivery),
        Conflict))]
pub(crate) async fn test_webhook(
    State(app): State<App>,
    Segments(webhook): Segments,
) -> Result<Json<WebhookDelivery>, Refusal> {
    Ok(Json(app.webhooks.test(&webhook).await?))
}

/// List the deliveries to a webhook
///
/// Lists the newest 200 events, delivered or not. A waiting delivery leaves the list only if 200
/// newer ones wait.
#[utoipa::path(get, path = "/v1/webhooks/{webhook}/deliveries",
    operation_id = "list_webhook_deliveries", tag = "webhooks",
    params(PageQuery, ("webhook" = Uuid, Path, description = "The webhook's id")),
    responses((status = 200, description = "A page of deliveries, newest event first",
        body = WebhookDeliveryPage)))]
pub(crate) async fn list_webhook_deliveries(
    State(app): State<App>,
    Segments(webhook): Segments,
    Params(query): Params<PageQuery>,
) -> Result<Json<WebhookDeliveryPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.webhooks.deliveries(&webhook, &query)).await?))
}

/// Get a delivery to a webhook
///
/// An event of a webhook with its body and every attempt to deliver it.
#[utoipa::path(get, path = "/v1/webhooks/{webhook}/deliveries/{delivery}",
    operation_id = "get_webhook_delivery", tag = "webhooks",
    params(("webhook" = Uuid, Path, description = "The webhook's id"),
        ("delivery" = Uuid, Path, description = "The event's id")),
    responses((status = 200, description = "The delivery", body = WebhookDelivery)))]
pub(crate) async fn get_webhook_delivery(
    State(app): State<App>,
    Segments((webhook, delivery)): Segments<(String, String)>,
) -> Result<Json<WebhookDelivery>, Refusal> {
    Ok(Json(app.webhooks.delivery(&webhook, &delivery)?))
}

/// Deliver an event again
///
/// Sends it now, under the same id, with as many attempts as a new one. 409 if the webhook is
/// disabled or an attempt is in flight.
#[utoipa::path(post, path = "/v1/webhooks/{webhook}/deliveries/{delivery}/redeliver",
    operation_id = "redeliver_webhook", tag = "webhooks",
    params(("webhook" = Uuid, Path, description = "The webhook's id"),
        ("delivery" = Uuid, Path, description = "The event's id")),
    responses((status = 200, description = "The delivery, which is due", body = WebhookDelivery),
        Conflict))]
pub(crate) async fn redeliver_webhook(
    State(app): State<App>,
    Segments((webhook, delivery)): Segments<(String, String)>,
) -> Result<Json<WebhookDelivery>, Refusal> {
    Ok(Json(app.webhooks.redeliver(&webhook, &delivery).await?))
}
