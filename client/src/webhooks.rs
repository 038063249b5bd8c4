//! Webhooks and the history of deliveries to them.

use palpate_schemas::{
    CreateWebhook, NewWebhook, PageQuery, RotateWebhookSecret, UpdateWebhook, Webhook,
    WebhookDelivery, WebhookDeliveryPage, WebhookPage,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Returns a page of the webhooks.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn webhooks(&self, page: &PageQuery) -> Result<WebhookPage, Error> {
        self.send(Request::get(["v1", "webhooks"]).page(page)).await
    }

    /// Returns a webhook.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn webhook(&self, webhook: &str) -> Result<Webhook, Error> {
        self.send(Request::get(["v1", "webhooks", webhook])).await
    }

    /// Creates a webhook and returns its secret, once.
    ///
    /// # Errors
    /// [`Error`]; status 422 for a URL that the server may not send to.
    pub async fn create_webhook(&self, webhook: &CreateWebhook) -> Result<NewWebhook, Error> {
        self.send(Request::post(["v1", "webhooks"]).json(webhook)).await
    }

    /// Changes a webhook, disables it or enables it again.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn update_webhook(
        &self,
        webhook: &str,
        changes: &UpdateWebhook,
    ) -> Result<Webhook, Error> {
        self.send(Request::patch(["v1", "webhooks", webhook]).json(changes)).await
    }

    /// Deletes a webhook with its history.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn delete_webhook(&self, webhook: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "webhooks", webhook])).await
    }

    /// Rotates a webhook's secret and returns the new one, once.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn rotate_webhook_secret(
        &self,
        webhook: &str,
        how: &RotateWebhookSecret,
    ) -> Result<NewWebhook, Error> {
        self.send(Request::post(["v1", "webhooks", webhook, "rotate"]).json(how)).await
    }

    /// Sends a test message and returns its delivery.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the webhook is disabled. A receiver that fails is no error.
    pub async fn test_webhook(&self, webhook: &str) -> Result<WebhookDelivery, Error> {
        self.send(Request::post(["v1", "webhooks", webhook, "test"])).await
    }

    /// Returns a page of the deliveries to a webhook, newest event first.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn webhook_deliveries(
        &self,
        webhook: &str,
        page: &PageQuery,
    ) -> Result<WebhookDeliveryPage, Error> {
        self.send(Request::get(["v1", "webhooks", webhook, "deliveries"]).page(page)).await
    }

    /// Returns a delivery, by its event's id.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn webhook_delivery(
        &self,
        webhook: &str,
        event: &str,
    ) -> Result<WebhookDelivery, Error> {
        self.send(Request::get(["v1", "webhooks", webhook, "deliveries", event])).await
    }

    /// Makes a delivery due again.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the webhook is disabled or an attempt is under way.
    pub async fn redeliver_webhook(
        &self,
        webhook: &str,
        event: &str,
    ) -> Result<WebhookDelivery, Error> {
        let path = ["v1", "webhooks", webhook, "deliveries", event, "redeliver"];
        self.send(Request::post(path)).await
    }
}
