//! The operations of the API, resource by resource. Each handler finds, parses, does and
//! answers; everything else lives behind it.

pub(crate) mod analyses;
pub(crate) mod audit;
mod blocks;
pub(crate) mod commissioning;
mod documented;
pub(crate) mod events;
pub(crate) mod fleet;
pub(crate) mod forwarding;
pub(crate) mod history;
pub(crate) mod jobs;
pub(crate) mod keys;
pub(crate) mod labels;
pub(crate) mod maps;
pub(crate) mod objects;
pub(crate) mod sensor_health;
pub(crate) mod sensors;
pub(crate) mod sessions;
pub(crate) mod site;
pub(crate) mod storage;
pub(crate) mod training;
pub(crate) mod webhooks;

use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::app::App;

/// Every route of the API, with its documentation.
pub(crate) fn api() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(site::livez))
        .routes(routes!(site::readyz))
        .routes(routes!(site::metrics))
        .routes(routes!(site::version))
        .routes(routes!(sensors::list_sensors, sensors::create_sensor))
        .routes(routes!(sensors::get_sensor, sensors::delete_sensor))
        .routes(routes!(sensors::check_reading))
        .routes(routes!(sensors::get_calibration, sensors::calibrate_sensor))
        .routes(routes!(sensor_health::get_sensor_health))
        .routes(routes!(commissioning::commission_sensor))
        .routes(routes!(commissioning::get_passport))
        .routes(routes!(commissioning::list_reference_bodies))
        .routes(routes!(commissioning::get_reference_mesh))
        .routes(routes!(analyses::analyse_coverings))
        .routes(routes!(objects::list_objects, objects::create_object))
        .routes(routes!(objects::get_object, objects::update_object, objects::delete_object))
        .routes(routes!(objects::get_mesh, objects::put_mesh))
        .routes(routes!(objects::get_thumbnail))
        .routes(routes!(objects::list_object_readings, objects::add_object_readings))
        .routes(routes!(training::list_catalogues))
        .routes(routes!(training::get_catalogue, training::delete_catalogue))
        .routes(routes!(training::start_training))
        .routes(routes!(training::recalibrate_catalogue))
        .routes(routes!(training::list_versions))
        .routes(routes!(training::get_version, training::delete_version))
        .routes(routes!(training::shadow_version))
        .routes(routes!(training::get_report))
        .routes(routes!(training::get_appearance_report))
        .routes(routes!(training::get_object_map))
        .routes(routes!(maps::get_interest))
        .routes(routes!(maps::get_occupancy))
        .routes(routes!(maps::get_occupancy_png))
        .routes(routes!(maps::get_occupancy_ply))
        .routes(routes!(maps::merge_maps))
        .routes(routes!(training::get_current, training::set_current))
        .routes(routes!(jobs::list_jobs))
        .routes(routes!(jobs::get_job, jobs::delete_job))
        .routes(routes!(jobs::cancel_job))
        .routes(routes!(events::job_events))
        .routes(routes!(sessions::list_sessions, sessions::create_session))
        .routes(routes!(
            sessions::get_session,
            sessions::delete_session,
            forwarding::forward_session
        ))
        .routes(routes!(sessions::close_session))
        .routes(routes!(sessions::extend_session))
        .routes(routes!(history::list_session_readings, sessions::add_readings))
        .routes(routes!(history::retract_reading))
        .routes(routes!(history::retract_robot_reading))
        .routes(routes!(history::replay_session))
        .routes(routes!(history::explain_session))
        .routes(routes!(sessions::get_belief))
        .routes(routes!(sessions::get_marginals))
        .routes(routes!(sessions::ask_next_touches))
        .routes(routes!(fleet::get_fleet))
        .routes(routes!(fleet::acknowledge_sessions))
        .routes(routes!(fleet::close_sessions))
        .routes(routes!(events::session_events))
        .routes(routes!(events::events))
        .routes(routes!(labels::set_session_labels))
        .routes(routes!(labels::set_object_labels))
        .routes(routes!(labels::set_sensor_labels))
        .routes(routes!(labels::set_catalogue_labels))
        .routes(routes!(labels::set_alias, labels::remove_alias))
        .routes(routes!(keys::list_keys, keys::create_key))
        .routes(routes!(keys::get_key, keys::revoke_key))
        .routes(routes!(keys::rotate_key))
        .routes(routes!(keys::whoami))
        .routes(routes!(keys::list_robots))
        .routes(routes!(keys::bind_robot, keys::release_robot))
        .routes(routes!(audit::list_audit))
        .routes(routes!(storage::take_snapshot))
        .routes(routes!(storage::compact))
        .routes(routes!(storage::get_storage))
        .merge(webhooks())
        .merge(cells())
}

/// The routes of webhooks and their deliveries.
fn webhooks() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(webhooks::list_webhooks, webhooks::create_webhook))
        .routes(routes!(webhooks::get_webhook, webhooks::update_webhook, webhooks::delete_webhook))
        .routes(routes!(webhooks::rotate_webhook_secret))
        .routes(routes!(webhooks::test_webhook))
        .routes(routes!(webhooks::list_webhook_deliveries))
        .routes(routes!(webhooks::get_webhook_delivery))
        .routes(routes!(webhooks::redeliver_webhook))
}

/// The routes of cells that forward, but for `PUT` of a session, which shares its path.
fn cells() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(forwarding::get_forwarding))
        .routes(routes!(forwarding::forward_entries))
        .routes(routes!(forwarding::get_package))
        .routes(routes!(forwarding::get_block))
        .routes(routes!(forwarding::get_sensor_package))
}

/// The answer to what made something: the thing, and the path that it has from now on.
pub(crate) fn created<T: Serialize>(path: String, made: T) -> Response {
    (StatusCode::CREATED, [(header::LOCATION, path)], Json(made)).into_response()
}
