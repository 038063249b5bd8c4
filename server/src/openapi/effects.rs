//! A table of where the effect of each field of a request body shows; no field may be missing.
//!
//! A field that is accepted and has no effect misleads its sender. The test compares names alone:
//! it sends no request. Fields of readings are walked over HTTP (`tests/http/contradictions.rs`).

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

/// Schema, its fields, and `>` a schema of answers that has fields of these names, or `@` a file of
/// `tests/http` in which these names stand. `>` alone: the schema itself is answered.
const EFFECTS: &str = "\
AcknowledgeSessions mute_s sessions @ fleet
AddReadings readings @ sessions
AddTrainingReadings readings @ objects
AnalyseCoverings element_width > CoveringAnalysis
AnalyseCoverings force_resolutions spreads thicknesses @ calibration
AppearanceTraining clustering descriptor discriminant_axes n_classes report_readings source variance_share >
AskNextTouches candidates deadline_ms n recenters seed sensor workspace @ next_touches
BindRobot key @ keys
BoundedPosePrior half_angle half_extents kind pose >
CalibrateSensor form > SensorCalibration
CalibrateSensor response spread @ calibration
CameraPosePrior class_weights hypotheses kind workspace wrong >
ClassWeight object weight >
CloseSession none_of_these object pose @ truth
CloseSessions sessions @ fleet
CommissionSensor apply object readings reference_body seed session_from_object @ commissioning
CommissioningReading image pose @ commissioning
Contact force_n normal normal_deviation_rad position position_deviation_m touched >
Coupling cross_talk edge gain_spread hysteresis kernel margin >
CreateKey expires_in_s @ keys
CreateKey name role > ApiKey
CreateObject description labels name > ObjectInfo
CreateSensor coupling image_order > SensorDescription
CreateSensor description labels name preset sensor_knowledge > Sensor
CreateSession alias version @ labels
CreateSession prior @ sessions
CreateSession bins catalogue frame_id labels method object_moves particles pose_prior risk robots seed ttl_s unknown_prior > Session
CreateWebhook description enabled events url > Webhook
CreateWebhook secret > NewWebhook
DescribeSensor coupling covering_thickness force_curve grid image_order noise point_spread quantisation ranges saturation taxels > SensorDescription
DistanceRange max min >
ExtendSession seconds @ leases
ForceKnot displacement pressure >
ForwardEntries entries from @ forwarding
ForwardSession cell session version_hash @ forwarding
ForwardedEntry reading retracts @ forwarding
GeometricTraining cell kind >
ImageOrder cols_reversed rows_reversed transposed >
Looseness angle_rad position_m >
MergeMaps activate version with @ geometry
NumberRange high low >
PlanarPosePrior angle center half_angle half_extent kind plane >
Point x y z >
Pose orientation position >
PriorEntry object probability @ sessions
Reading approach_m contact feature frame_id image object_moved pose robot sensor seq shear stamp @ contradictions
RecalibrateCatalogue activate sensor sessions version >
ResponsePress col depth pressures row @ calibration
RobotBase base robot >
RotateKey grace_s @ keys
RotateWebhookSecret grace_s secret @ webhook_limits
SensorRanges cross_talk edges kernels margin spread_factor stiffening stiffness >
SetAlias version @ labels
SetCurrent version > CurrentVersion
SetLabels labels @ labels
ShadowVersion against risk sessions >
SpreadPress depth pressures x y @ calibration
SpreadPresses covering_thickness indenter_diameter presses @ calibration
Stamp nanosec sec >
StartTraining activate appearance descriptor distance_range extend geometric n_classes objects readings_per_object seed sensor sensor_knowledge strict surface surface_readings_per_object sva >
StatedPose covariance deviation object pose weight >
Taxel normal position width >
TaxelGrid cols pitch rows taxel_width >
TouchCandidate cost pose reach_m @ next_touches
TouchWorkspace center radius @ next_touches
UpdateObject description name > ObjectInfo
UpdateWebhook description enabled events url > Webhook
VersionReference catalogue version >
WorkspaceBox high low >
";

/// The schemas that a part of the description refers to, directly or through others.
fn referred<'a>(part: &'a Value, schemas: &'a Value, found: &mut BTreeSet<&'a str>) {
    if let Some(name) = part.get("$ref").and_then(Value::as_str) {
        let name = name.rsplit('/').next().unwrap();
        if schemas.get(name).is_some() && found.insert(name) {
            referred(&schemas[name], schemas, found);
        }
    }
    match part {
        Value::Object(fields) => {
            fields
                .iter()
                .filter(|(name, _)| !name.starts_with("example"))
                .for_each(|(_, field)| referred(field, schemas, found));
        }
        Value::Array(items) => items.iter().for_each(|item| referred(item, schemas, found)),
        _ => {}
    }
}

/// The fields of a schema, of all its variants.
fn fields(schema: &Value) -> BTreeSet<&str> {
    let own = schema["properties"].as_object().into_iter().flatten();
    let mut all: BTreeSet<&str> = own.map(|(name, _)| name.as_str()).collect();
    for kind in ["allOf", "anyOf", "oneOf"] {
        all.extend(schema[kind].as_array().into_iter().flatten().flat_map(fields));
    }
    all
}

#[test]
fn every_field_of_a_request_has_a_line() {
    let description: Value = serde_json::from_str(super::text()).unwrap();
    let schemas = &description["components"]["schemas"];
    let (mut asked, mut answered) = (BTreeSet::new(), BTreeSet::new());
    for item in description["paths"].as_object().unwrap().values() {
        for operation in item.as_object().unwrap().values() {
            referred(&operation["requestBody"], schemas, &mut asked);
            referred(&operation["responses"], schemas, &mut answered);
        }
    }
    let mut observed: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for line in EFFECTS.lines() {
        let (given, by) = line.split_once(['>', '@']).unwrap();
        let mut given = given.split_whitespace();
        let (schema, by) = (given.next().unwrap(), by.trim());
        let names: Vec<&str> = given.collect();
        if line.contains('>') {
            let answer = if by.is_empty() { schema } else { by };
            assert!(answered.contains(answer), "{line}: {answer} is no answer");
            let its = fields(&schemas[answer]);
            let missing = names.iter().find(|name| !its.contains(**name));
            assert_eq!(missing, None, "{line}");
        } else {
            let path = format!("{}/tests/http/{by}.rs", env!("CARGO_MANIFEST_DIR"));
            let test = std::fs::read_to_string(&path).unwrap();
            let missing = names.iter().find(|name| !test.contains(&format!("\"{name}\"")));
            assert_eq!(missing, None, "{line}: the test does not send it");
        }
        observed.entry(schema).or_default().extend(names);
    }
    for schema in asked {
        let its = fields(&schemas[schema]);
        let known = observed.remove(schema).unwrap_or_default();
        assert_eq!(its, known, "{schema}: every field needs a line in EFFECTS");
    }
    assert!(observed.is_empty(), "no request has {observed:?}");
}
