//! Every way by which readings come into a session refuses and warns of the same.

use palpate_core::pose::Pose;
use palpate_server::Access;
use reqwest::Method;
use serde_json::{Value, json};

use crate::forwarding::{id_at, now_ms};
use crate::harness::{Answer, CUBE, Harness, quiet_reading, touches};

/// A way by which readings come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Json,
    MessagePack,
    Forwarded,
}

const WAYS: [Way; 3] = [Way::Json, Way::MessagePack, Way::Forwarded];

/// A server that requires keys, with a session for each way.
struct Doors {
    it: Harness,
    sessions: [String; 3],
}

impl Doors {
    async fn new() -> Self {
        let it = Harness::trained_with(|config| {
            config.access = Access::Keys;
            config.session_readings_max = 3;
        })
        .await;
        let package = it.get("/v1/catalogues/default/versions/1/package").await.expect(200);
        let forwarded = id_at(now_ms());
        let body = json!({"cell": "cell-7", "version_hash": package["hash"],
            "session": {"catalogue": "default", "version": 1}});
        let body = Some(("application/json", body.to_string().into_bytes()));
        it.send(Method::PUT, &format!("/v1/sessions/{forwarded}"), body).await.expect(200);
        let sessions = [it.session(json!({})).await, it.session(json!({})).await, forwarded];
        Self { it, sessions }
    }

    fn session(&self, way: Way) -> &str {
        &self.sessions[way as usize]
    }

    async fn revision(&self, way: Way) -> Value {
        let shown = self.it.get(&format!("/v1/sessions/{}", self.session(way))).await;
        shown.expect(200)["revision"].clone()
    }

    /// Brings readings behind those that are there.
    async fn bring(&self, way: Way, readings: &[Value]) -> Answer {
        let session = self.session(way);
        let path = format!("/v1/sessions/{session}/readings");
        match way {
            Way::Json => self.it.post(&path, &json!({"readings": readings})).await,
            Way::MessagePack => {
                let bytes = rmp_serde::to_vec_named(&json!({"readings": readings})).unwrap();
                self.it.send(Method::POST, &path, Some(("application/msgpack", bytes))).await
            }
            Way::Forwarded => {
                let entries: Vec<Value> =
                    readings.iter().map(|reading| json!({ "reading": reading })).collect();
                let body = json!({"from": self.revision(way).await, "entries": entries});
                self.it.post(&format!("/v1/sessions/{session}/forwarded"), &body).await
            }
        }
    }

    /// Refuses the same by every way, at a field of the first reading, and stores nothing.
    async fn refuse(&self, what: &str, readings: &[Value], status: u16, field: &str) {
        for way in WAYS {
            let before = self.revision(way).await;
            let refused = self.bring(way, readings).await;
            assert_eq!(refused.status, status, "{what}, {way:?}: {}", refused.text);
            let list = if way == Way::Forwarded { "/entries" } else { "/readings" };
            let expected = match (field, way) {
                ("", _) => list.to_owned(),
                (field, Way::Forwarded) => format!("/entries/0/reading{field}"),
                (field, _) => format!("/readings/0{field}"),
            };
            let pointer = &refused.json()["errors"][0]["pointer"];
            let is_there = pointer.as_str().is_some_and(|it| it.starts_with(&expected));
            // A session that is full or has ended refuses no field.
            assert!(is_there || field == "*", "{what}, {way:?}: {}", refused.text);
            assert_eq!(self.revision(way).await, before, "{what}, {way:?}");
        }
    }
}

/// A reading with another value in a field.
fn with(field: &str, value: Value) -> Value {
    let mut reading = quiet_reading();
    reading[field] = value;
    reading
}

fn by(robot: &str, seq: u64) -> Value {
    let mut reading = with("robot", json!(robot));
    reading["seq"] = json!(seq);
    reading
}

#[tokio::test(flavor = "multi_thread")]
async fn every_way_into_a_session_refuses_the_same() {
    let mut doors = Doors::new().await;
    let admin = doors.it.key.clone();
    let owner = doors.it.new_key("owner", "robot").await;
    let other = doors.it.new_key("other", "robot").await;
    doors.it.key = Some(owner);
    doors.bring(Way::Json, &[by("arm-A", 0)]).await.expect(200);
    doors.it.key = Some(other);
    let wrong = [
        ("an unknown sensor", with("sensor", json!("nothing")), "/sensor"),
        ("another number of taxels", with("image", json!([1.0])), "/image"),
        ("no pose", with("pose", Value::Null), "/pose"),
        ("a feature for a method without", with("feature", json!([1.0])), "/feature"),
        ("a far approach", with("approach_m", json!(11.0)), "/approach_m"),
        (
            "a far position",
            with(
                "pose",
                json!({"position": [1e9, 0, 0],
            "orientation": [0, 0, 0, 1]}),
            ),
            "/pose/position/0",
        ),
        (
            "an object that moved too far",
            with(
                "object_moved",
                json!({"position_m": 9.0,
            "angle_rad": 0.1}),
            ),
            "/object_moved/position_m",
        ),
        ("another frame", with("frame_id", json!("x".repeat(300))), "/frame_id"),
        ("a robot without a number", with("robot", json!("arm-B")), ""),
    ];
    for (what, reading, field) in wrong {
        doors.refuse(what, &[reading], 422, field).await;
    }
    doors.refuse("a robot of another key", &[by("arm-A", 1)], 403, "/robot").await;
    doors.refuse("no readings", &[], 422, "").await;
    doors.refuse("too many readings", &vec![quiet_reading(); 1001], 422, "").await;
    let large = with("feature", json!(vec![0; 4001]));
    doors.refuse("too many values", &vec![large; 1000], 422, "").await;
    doors.refuse("more than a session takes", &vec![quiet_reading(); 4], 409, "*").await;
    // A name that came by forwarding belongs to its key as well.
    doors.bring(Way::Forwarded, &[by("arm-C", 0)]).await.expect(200);
    doors.it.key = admin;
    let third = doors.it.new_key("third", "robot").await;
    let admin = doors.it.key.replace(third);
    doors.refuse("a robot that was forwarded", &[by("arm-C", 9)], 403, "/robot").await;
    let log = doors.it.send_as(admin.as_deref(), Method::GET, "/v1/audit?limit=1000").await;
    for operation in ["add_readings", "forward_entries"] {
        let items = log.expect(200)["items"].as_array().unwrap().clone();
        let is_told =
            |entry: &Value| entry["operation"] == operation && entry["status"] == json!(403);
        assert!(items.iter().any(is_told), "{operation} is in the audit log");
    }
    doors.it.key = admin;
    for way in WAYS {
        let path = format!("/v1/sessions/{}/close", doors.session(way));
        doors.it.post(&path, &json!({})).await.expect(200);
    }
    // The end is an entry of the journal.
    for way in [Way::Json, Way::MessagePack] {
        doors.bring(way, &[quiet_reading()]).await.problem(410, "session-ended", None);
    }
    let body = json!({"from": 1, "entries": [{"reading": quiet_reading()}]});
    let path = format!("/v1/sessions/{}/forwarded", doors.session(Way::Forwarded));
    doors.it.post(&path, &body).await.problem(410, "session-ended", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_way_into_a_session_warns_of_the_same() {
    let doors = Doors::new().await;
    let mut readings = touches(CUBE, 2, 5, Pose::IDENTITY);
    for pressure in readings[1]["image"].as_array_mut().unwrap() {
        *pressure = json!(pressure.as_f64().unwrap() / 1000.0);
    }
    for way in WAYS {
        let answer = doors.bring(way, &readings).await.expect(200);
        let warning = &answer["warnings"][0];
        assert_eq!(warning["code"], "pressure_unit", "{way:?}: {answer}");
        let pointer = match way {
            Way::Forwarded => "/entries/1/reading/image",
            Way::Json | Way::MessagePack => "/readings/1/image",
        };
        assert_eq!(warning["pointer"], pointer, "{way:?}: {answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn ids_from_outside_carry_a_believable_time() {
    let doors = Doors::new().await;
    let package = doors.it.get("/v1/catalogues/default/versions/1/package").await.expect(200);
    let body = json!({"cell": "cell-7", "version_hash": package["hash"],
        "session": {"catalogue": "default", "version": 1}});
    let (now, day) = (now_ms(), 86_400_000);
    let put = async |ms: u64| {
        let body = Some(("application/json", body.to_string().into_bytes()));
        doors.it.send(Method::PUT, &format!("/v1/sessions/{}", id_at(ms)), body).await
    };
    let far = [0, 1, now - 400 * day, now + 2 * day, now + 400 * day, (1 << 48) - 1];
    for ms in far {
        put(ms).await.problem(422, "invalid-value", Some("path:session"));
        doors.it.get(&format!("/v1/sessions/{}", id_at(ms))).await.problem(404, "not-found", None);
    }
    for ms in [now - 300 * day, now - day, now + day / 2] {
        put(ms).await.expect(200);
    }
}
