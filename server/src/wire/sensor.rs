//! Conversion of sensors: descriptions and checks of readings.

use std::sync::Arc;

use palpate_core::contact::{CONTACT_SHARE, center_of_pressure};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::{
    ForceCurve, ImageOrder, Preset, SensorDescription, SensorError, SensorKnowledge,
    SensorParameters, TaxelGrid, defaults,
};
use palpate_schemas as wire;
use palpate_store::entity::Sensor;
use uuid::Uuid;

use crate::hints::{Hint, Judged};
use crate::wire::reading::Applied;
use crate::wire::{Invalid, coupling, layout, time};

/// A stored sensor and the numbers of what applies to it in their wire form.
pub(crate) fn sensor(sensor: &Sensor, applied: Option<&Applied>) -> wire::Sensor {
    wire::Sensor {
        id: sensor.id,
        name: sensor.name.clone(),
        preset: sensor.preset.clone(),
        labels: sensor.labels.clone(),
        description: description(sensor),
        layout: layout::layout(&sensor.description),
        sensor_knowledge: coupling::knowledge(sensor.knowledge),
        calibration: applied.map(|applied| applied.number),
        passport: applied.and_then(|applied| applied.passport),
        created_at: time(sensor.created_at_ms),
    }
}

/// A new sensor, checked.
pub(crate) fn new_sensor(
    request: &wire::CreateSensor,
    id: Uuid,
    created_at_ms: u64,
) -> Result<Sensor, Invalid> {
    super::name(&request.name)?;
    let (description, ranges) = match (request.preset, &request.description) {
        (Some(preset), None) => {
            let known = Preset::named(preset.name())
                .ok_or_else(|| Invalid::field("/preset", "not known to this server"))?;
            (known.description, known.ranges)
        }
        (None, Some(given)) => {
            let ranges = coupling::stated_ranges(given.ranges.as_ref())?;
            (checked_description(given)?, ranges)
        }
        (Some(_), Some(_)) | (None, None) => {
            return Err(Invalid::field("/preset", "expected either a preset or a description"));
        }
    };
    let description = overridden(&description, request)?;
    if request.sensor_knowledge == Some(wire::SensorKnowledge::Commissioned) {
        let detail = "came `commissioned`, expected `measured` or `data_sheet`: a sensor is \
                      commissioned by touches of a known object";
        return Err(Invalid::field("/sensor_knowledge", detail));
    }
    let knowledge =
        request.sensor_knowledge.map_or(SensorKnowledge::DataSheet, coupling::knowledge_of);
    let is_stated = request.description.is_some() && !ranges.is_empty();
    if knowledge == SensorKnowledge::Measured && is_stated {
        let detail = "came with `sensor_knowledge` `measured`, which leaves nothing open";
        return Err(Invalid::field("/description/ranges", detail));
    }
    let (name, preset) = (request.name.clone(), request.preset.map(|p| p.name().to_owned()));
    super::labels::checked(&request.labels)?;
    let (labels, used) = (request.labels.clone(), false);
    Ok(Sensor { id, name, preset, description, knowledge, ranges, labels, used, created_at_ms })
}

/// The knots of a force curve in their wire form.
pub(crate) fn force_curve(curve: &ForceCurve) -> Vec<wire::ForceKnot> {
    let knot = |&(displacement, pressure): &(f64, f64)| wire::ForceKnot { displacement, pressure };
    curve.knots().iter().map(knot).collect()
}

fn description(sensor: &Sensor) -> wire::SensorDescription {
    let description = &sensor.description;
    let parameters = description.parameters();
    let grid = &parameters.grid;
    wire::SensorDescription {
        grid: wire::TaxelGrid {
            rows: grid.rows as u32,
            cols: grid.cols as u32,
            pitch: grid.pitch,
            taxel_width: grid.taxel_width,
        },
        taxels: layout::taxels(description),
        covering_thickness: parameters.covering_thickness,
        point_spread: parameters.point_spread,
        force_curve: force_curve(&parameters.force_curve),
        saturation: parameters.saturation,
        noise: parameters.noise,
        quantisation: parameters.quantisation,
        image_order: wire::ImageOrder {
            transposed: parameters.image_order.transposed,
            rows_reversed: parameters.image_order.rows_reversed,
            cols_reversed: parameters.image_order.cols_reversed,
        },
        coupling: coupling::coupling(&parameters.coupling),
        ranges: sensor.family(sensor.knowledge).ranges().map(coupling::ranges),
    }
}

/// The checked description, with defaults for missing properties.
fn checked_description(given: &wire::DescribeSensor) -> Result<SensorDescription, Invalid> {
    let (thickness, saturation) = (given.covering_thickness, given.saturation);
    let force_curve = match &given.force_curve {
        None => defaults::force_curve(thickness, saturation),
        Some(knots) => {
            let knots = knots.iter().map(|knot| (knot.displacement, knot.pressure)).collect();
            ForceCurve::new(knots).map_err(refuse)?
        }
    };
    let stated = given.grid.as_ref().map(|grid| TaxelGrid {
        rows: grid.rows as usize,
        cols: grid.cols as usize,
        pitch: grid.pitch,
        taxel_width: grid.taxel_width,
    });
    let layout = given.taxels.as_ref().map(|taxels| layout::layout_of(taxels, stated));
    let layout = layout.transpose()?.map(Arc::new);
    let Some(grid) = stated.or_else(|| layout.as_ref().map(|layout| *layout.grid())) else {
        let detail = "is missing, expected the grid of the taxels, or `taxels` as a list";
        return Err(Invalid::field("/description/grid", detail));
    };
    let parameters = SensorParameters {
        grid,
        layout,
        covering_thickness: thickness,
        point_spread: given.point_spread.unwrap_or_else(|| point_spread_of_covering(thickness)),
        force_curve,
        saturation,
        noise: given.noise.unwrap_or_else(|| defaults::noise(saturation, given.quantisation)),
        quantisation: given.quantisation,
        image_order: order(given.image_order),
        coupling: coupling::coupling_of(&given.coupling),
    };
    SensorDescription::new(parameters).map_err(refuse)
}

/// The description with what the request overrides.
fn overridden(
    description: &SensorDescription,
    request: &wire::CreateSensor,
) -> Result<SensorDescription, Invalid> {
    let known = description.parameters().clone();
    let changed = SensorParameters {
        image_order: request.image_order.map_or(known.image_order, order),
        coupling: request.coupling.as_ref().map_or(known.coupling, coupling::coupling_of),
        ..known
    };
    let of_request = |error: SensorError| match error {
        SensorError::Range { field, .. } => Invalid::field(format!("/coupling/{field}"), error),
        other => refuse(other),
    };
    SensorDescription::new(changed).map_err(of_request)
}

fn order(given: wire::ImageOrder) -> ImageOrder {
    ImageOrder {
        transposed: given.transposed,
        rows_reversed: given.rows_reversed,
        cols_reversed: given.cols_reversed,
    }
}

fn refuse(error: SensorError) -> Invalid {
    let pointer = match &error {
        SensorError::Count { field, .. } => format!("/description/grid/{field}"),
        SensorError::Range { field: field @ ("pitch" | "taxel_width"), .. } => {
            format!("/description/grid/{field}")
        }
        SensorError::Range {
            field: field @ ("margin" | "cross_talk" | "gain_spread" | "hysteresis"),
            ..
        } => format!("/description/coupling/{field}"),
        SensorError::Range { field, .. } => format!("/description/{field}"),
        SensorError::Order { field, .. } | SensorError::Empty { field } => {
            format!("/description/ranges/{field}")
        }
        SensorError::ForceCurve { knot } => format!("/description/force_curve/{knot}"),
        SensorError::Layout(error) => return layout::refuse(error.clone()),
        SensorError::OrderOfLayout => "/description/image_order".to_owned(),
    };
    Invalid::field(pointer, error)
}

/// The interpretation of a reading.
pub(crate) fn check(
    reading: &Reading,
    session_from_sensor: Option<Pose>,
    description: &SensorDescription,
    applied: Option<&Applied>,
) -> wire::ReadingCheck {
    let (image, parameters) = (reading.image(), description.parameters());
    let indices = |fits: &dyn Fn(usize, f64) -> bool| -> Vec<u32> {
        let taxels = image.pressures.iter().enumerate();
        taxels.filter(|&(taxel, &p)| fits(taxel, p)).map(|(taxel, _)| taxel as u32).collect()
    };
    let max_pressure = image.max();
    let (half, floor) = (CONTACT_SHARE * max_pressure, description.contact_floor());
    let contact = indices(&|_, pressure| pressure > floor && pressure >= half);
    let missing = indices(&|taxel, _| reading.missing()[taxel]);
    let saturated = indices(&|_, pressure| pressure >= parameters.saturation);
    let center = center_of_pressure(image, description);
    let touches = !contact.is_empty();
    let in_session = |pose: Pose| point((pose * center).to_array());
    let looks = |pose: Pose| point(pose.turn([0.0, 0.0, 1.0].into()).to_array());
    let judged = Judged::press(reading, description, session_from_sensor);
    let warnings = crate::hints::of_reading(judged);
    let hints = hints(&warnings, image.pressures.len(), missing.len(), touches);
    wire::ReadingCheck {
        rows: image.rows as u32,
        cols: image.cols as u32,
        image: image.pressures.clone(),
        missing,
        saturated,
        contact,
        max_pressure,
        centroid_in_sensor: touches.then(|| point(center.to_array())),
        centroid_in_session: session_from_sensor.filter(|_| touches).map(in_session),
        sensor_z_in_session: session_from_sensor.map(looks),
        calibration: applied.map(|applied| applied.number),
        passport: applied.and_then(|applied| applied.passport),
        unusable: applied.map_or_else(Vec::new, |applied| {
            let is_unusable = |taxel: &u32| !applied.correction.is_usable(*taxel as usize);
            (0..image.pressures.len() as u32).filter(is_unusable).collect()
        }),
        hints,
        warnings: warnings.into_iter().map(warning).collect(),
    }
}

fn warning(hint: Hint) -> wire::Warning {
    wire::Warning { code: hint.code, pointer: hint.field.to_owned(), detail: hint.detail }
}

/// Remarks on a reading, in words: probable mistakes, and unexpected properties.
fn hints(warnings: &[Hint], n_taxels: usize, n_missing: usize, touches: bool) -> Vec<String> {
    let mut hints: Vec<String> = warnings.iter().map(|hint| hint.detail.clone()).collect();
    let is_unit = |hint: &Hint| hint.code == wire::WarningCode::PressureUnit;
    if !touches && !warnings.iter().any(is_unit) {
        hints.push("nothing is touched: send it all the same, free space is evidence".to_owned());
    }
    if n_missing > 0 {
        hints.push(format!(
            "{n_missing} of {n_taxels} taxels have no value; neighbours stand in for them"
        ));
    }
    hints
}

/// Three numbers in their wire form.
fn point([x, y, z]: [f64; 3]) -> wire::Point {
    wire::Point { x, y, z }
}

/// A pose in its wire form.
pub(crate) fn pose(pose: &Pose) -> wire::Pose {
    wire::Pose { position: pose.translation.to_array(), orientation: pose.rotation.to_array() }
}
