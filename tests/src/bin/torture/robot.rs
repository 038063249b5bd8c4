//! A client that writes as fast as it is answered, until the server is gone.

use std::time::Duration;

use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::sync::watch;

use crate::http::{Outcome, answer, send};
use crate::keys;
use crate::ledger::{Fate, Ledger, Object, Sent, Session};
use crate::material::{Material, off_box};
use crate::pauses::Pauses;

/// Maximum readings of a session.
const READINGS_MAX: usize = 40;
/// Maximum open sessions of one client.
const OPEN_MAX: usize = 4;
/// Maximum objects of one client that are not deleted.
const OBJECTS_MAX: usize = 4;
/// With keys: one request in this many creates or revokes one.
const KEYS_EVERY: usize = 12;
/// Pause before a robot goes on with another server. Chosen: what a robot's own connection takes.
const RECONNECT_AFTER: Duration = Duration::from_millis(200);
/// Recognition methods, drawn for each session.
const METHODS: [&str; 3] = ["surface", "sva", "appearance"];

/// One client.
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) client: Client,
    /// The client for objects, calibrations and trainings; with another key where keys are
    /// required.
    pub(crate) teacher: Client,
    /// The client that creates and revokes keys, where they are required.
    pub(crate) keeper: Option<Client>,
    pub(crate) ledger: Ledger,
    stream: Stream,
    n_named: u64,
}

impl Robot {
    /// The robots of a run, each with choices of its own.
    pub(crate) fn all(n: u32, seed: u64, client: &Client) -> Vec<Self> {
        let robot = |writer: u32| {
            let stream = Stream::new(seed, Purpose::ReadingChoice, u64::from(writer));
            Self::new(format!("robot-{writer}"), client.clone(), stream)
        };
        (0..n).map(robot).collect()
    }

    pub(crate) fn new(name: String, client: Client, stream: Stream) -> Self {
        let (teacher, ledger) = (client.clone(), Ledger::default());
        Self { name, client, teacher, keeper: None, ledger, stream, n_named: 0 }
    }

    /// The name of its sensor, which no other client calibrates.
    pub(crate) fn sensor(&self) -> String {
        format!("sensor-{}", self.name)
    }

    /// The name of its catalogue.
    pub(crate) fn catalogue(&self) -> String {
        format!("own-{}", self.name)
    }

    /// Writes until a request is not answered.
    pub(crate) async fn write(&mut self, url: &str, material: &Material) {
        while !self.step(url, material).await {}
    }

    /// Makes one request; true when the server is gone.
    async fn step(&mut self, url: &str, material: &Material) -> bool {
        let keeper = self.keeper.clone();
        if let Some(keeper) = keeper.filter(|_| self.stream.index(KEYS_EVERY) == 0) {
            let fresh = self.fresh("key");
            let outcome = keys::change(&keeper, url, &mut self.ledger, fresh).await;
            return self.note(outcome);
        }
        let outcome = match self.stream.index(100) {
            0..70 => self.touch(url, material).await,
            70..76 => self.close_or_delete(url).await,
            76..85 => self.object(url).await,
            85..93 => self.train_object(url, material).await,
            93..97 => self.calibrate(url, material).await,
            97..99 => self.delete_object(url).await,
            _ => self.train(url).await,
        };
        self.note(outcome)
    }

    /// Writes until `ends` is true: to the server at `place`, and when that does not answer to the
    /// next one.
    pub(crate) async fn write_anywhere(
        &mut self,
        urls: &[String],
        place: usize,
        material: &Material,
        (pauses, ends): (&Pauses, watch::Receiver<bool>),
    ) {
        for url in urls.iter().cycle().skip(place % urls.len()) {
            if self.write_to(url, material, pauses, &ends).await {
                return;
            }
            // What the server that is gone acknowledged, the next one knows a moment later.
            tokio::time::sleep(RECONNECT_AFTER).await;
        }
    }

    /// Writes to a server until it does not answer; true when the time to write has ended.
    async fn write_to(
        &mut self,
        url: &str,
        material: &Material,
        pauses: &Pauses,
        ends: &watch::Receiver<bool>,
    ) -> bool {
        while !*ends.borrow() {
            let before = self.ledger.acknowledged;
            if self.step(url, material).await {
                return false;
            }
            // Later nobody else writes.
            if self.ledger.acknowledged > before && !*ends.borrow() {
                pauses.acknowledged();
            }
        }
        true
    }

    /// Records an outcome; true when the server is gone.
    fn note(&mut self, outcome: Outcome) -> bool {
        match outcome {
            Outcome::Done(_) => self.ledger.acknowledged += 1,
            // An overloaded server answers 503; any other refusal is unexpected.
            Outcome::Refused(503, _) => {}
            Outcome::Refused(status, ref body) => {
                self.ledger.unexpected.push(format!("{}: {status} {body}", self.name));
            }
            Outcome::Unknown => self.ledger.unanswered += 1,
        }
        matches!(outcome, Outcome::Unknown)
    }

    fn fresh(&mut self, what: &str) -> String {
        self.n_named += 1;
        format!("{what}-{}-{}", self.name, self.n_named)
    }

    /// Sends one to three readings into one of its sessions, or starts one.
    async fn touch(&mut self, url: &str, material: &Material) -> Outcome {
        let open: Vec<usize> = (0..self.ledger.sessions.len())
            .filter(|place| {
                let session = &self.ledger.sessions[*place];
                session.is_open() && session.readings.len() < READINGS_MAX
            })
            .collect();
        if open.is_empty() || (open.len() < OPEN_MAX && self.stream.index(8) == 0) {
            return self.begin(url).await;
        }
        let place = open[self.stream.index(open.len())];
        let object = place % material.touches.len();
        let first = self.ledger.sessions[place].readings.len();
        let n_new = 1 + self.stream.index(3);
        for seq in first..first + n_new {
            let touches = &material.touches[object];
            let mut reading = touches[self.stream.index(touches.len())].clone();
            (reading["robot"], reading["seq"]) = (json!(self.name), json!(seq));
            let sent = Sent { reading, fate: Fate::Unknown };
            self.ledger.sessions[place].readings.push(sent);
        }
        let detail = ["none", "none", "none", "none", "top", "full"][self.stream.index(6)];
        let session = &mut self.ledger.sessions[place];
        session.is_fresh = true;
        let readings: Vec<&Value> = session.readings[first..].iter().map(|s| &s.reading).collect();
        let path = format!("{url}/v1/sessions/{}/readings?belief={detail}", session.id);
        let body = json!({ "readings": readings });
        let outcome = send(&self.client, Method::POST, path, Some(&body)).await;
        match &outcome {
            Outcome::Done(_) => {
                session.readings[first..].iter_mut().for_each(|s| s.fate = Fate::Acknowledged);
            }
            Outcome::Refused(..) => session.readings.truncate(first),
            Outcome::Unknown => {}
        }
        outcome
    }

    async fn begin(&mut self, url: &str) -> Outcome {
        let method = METHODS[self.stream.index(METHODS.len())];
        let request = json!({ "method": method });
        let path = format!("{url}/v1/sessions");
        let outcome = send(&self.client, Method::POST, path, Some(&request)).await;
        match &outcome {
            Outcome::Done(body) => self.ledger.sessions.push(Session {
                id: body["id"].as_str().unwrap_or_default().to_owned(),
                request,
                readings: Vec::new(),
                closed: None,
                deleted: None,
                is_fresh: true,
            }),
            Outcome::Refused(..) => {}
            Outcome::Unknown => self.ledger.sessions_unknown += 1,
        }
        outcome
    }

    async fn close_or_delete(&mut self, url: &str) -> Outcome {
        let is_deletion = self.stream.index(3) == 0;
        let open = self.ledger.sessions.iter().position(Session::is_open);
        let Some(place) = open else { return self.begin(url).await };
        let session = &mut self.ledger.sessions[place];
        session.is_fresh = true;
        let path = format!("{url}/v1/sessions/{}", session.id);
        let outcome = if is_deletion {
            send(&self.client, Method::DELETE, path, None).await
        } else {
            send(&self.client, Method::POST, format!("{path}/close"), None).await
        };
        let fate = fate(&outcome);
        let field = if is_deletion { &mut session.deleted } else { &mut session.closed };
        *field = fate;
        outcome
    }

    /// Adds an object, or gives one a mesh.
    async fn object(&mut self, url: &str) -> Outcome {
        let known = self.living();
        if known.len() < OBJECTS_MAX && self.stream.index(2) == 0 || known.is_empty() {
            let name = self.fresh("object");
            let body = json!({ "name": name });
            let path = format!("{url}/v1/objects");
            let outcome = send(&self.teacher, Method::POST, path, Some(&body)).await;
            if let Some(created) = fate(&outcome) {
                let object = Object {
                    created,
                    deleted: None,
                    meshes: Vec::new(),
                    n_readings: 0,
                    n_readings_unknown: 0,
                };
                self.ledger.objects.insert(name, object);
            }
            return outcome;
        }
        let name = known[self.stream.index(known.len())].clone();
        let file = off_box([30.0, 20.0, 10.0], 1 + self.stream.index(1500));
        let request = self.teacher.put(format!("{url}/v1/objects/{name}/mesh?unit=mm"));
        let length = file.len();
        let outcome = answer(request.header("content-type", "model/off").body(file)).await;
        if let (Some(fate), Some(object)) = (fate(&outcome), self.ledger.objects.get_mut(&name)) {
            if fate == Fate::Acknowledged {
                object.meshes.clear();
            }
            object.meshes.push((length, fate));
        }
        outcome
    }

    /// Sends training readings of one of its objects.
    async fn train_object(&mut self, url: &str, material: &Material) -> Outcome {
        let known = self.living();
        let Some(name) = known.first() else { return self.object(url).await };
        let touches = &material.touches[0];
        let n_new = 1 + self.stream.index(4);
        let readings: Vec<Value> = (0..n_new)
            .map(|_| {
                let mut reading = touches[self.stream.index(touches.len())].clone();
                self.n_named += 1;
                (reading["robot"], reading["seq"]) = (json!(self.name), json!(self.n_named));
                reading
            })
            .collect();
        let path = format!("{url}/v1/objects/{name}/readings");
        let body = json!({ "readings": readings });
        let outcome = send(&self.teacher, Method::POST, path, Some(&body)).await;
        if let (Some(fate), Some(object)) = (fate(&outcome), self.ledger.objects.get_mut(name)) {
            match fate {
                Fate::Acknowledged => object.n_readings += n_new as u64,
                Fate::Unknown => object.n_readings_unknown += n_new as u64,
            }
        }
        outcome
    }

    async fn delete_object(&mut self, url: &str) -> Outcome {
        let known = self.living();
        let Some(name) = known.last() else { return self.object(url).await };
        let path = format!("{url}/v1/objects/{name}");
        let outcome = send(&self.teacher, Method::DELETE, path, None).await;
        if let (Some(fate), Some(object)) = (fate(&outcome), self.ledger.objects.get_mut(name)) {
            object.deleted = Some(fate);
        }
        outcome
    }

    async fn calibrate(&mut self, url: &str, material: &Material) -> Outcome {
        let path = format!("{url}/v1/sensors/{}/calibration", self.sensor());
        let outcome = send(&self.teacher, Method::POST, path, Some(&material.indentations)).await;
        match fate(&outcome) {
            Some(Fate::Acknowledged) => self.ledger.calibrations += 1,
            Some(Fate::Unknown) => self.ledger.calibrations_unknown += 1,
            None => {}
        }
        outcome
    }

    /// Starts a small training of its own catalogue.
    async fn train(&mut self, url: &str) -> Outcome {
        let training = json!({"objects": ["cube", "bar"], "readings_per_object": 40,
            "n_classes": 4, "seed": self.stream.index(1000)});
        let path = format!("{url}/v1/catalogues/{}/trainings", self.catalogue());
        let outcome = send(&self.teacher, Method::POST, path, Some(&training)).await;
        match &outcome {
            Outcome::Done(job) => {
                self.ledger.jobs.push(job["id"].as_str().unwrap_or_default().to_owned());
            }
            Outcome::Refused(..) => {}
            Outcome::Unknown => self.ledger.jobs_unknown += 1,
        }
        outcome
    }

    /// The names of its objects that are not deleted.
    fn living(&self) -> Vec<String> {
        let objects = self.ledger.objects.iter();
        let living = objects
            .filter(|(_, object)| object.created == Fate::Acknowledged && object.deleted.is_none());
        living.map(|(name, _)| name.clone()).collect()
    }
}

fn fate(outcome: &Outcome) -> Option<Fate> {
    match outcome {
        Outcome::Done(_) => Some(Fate::Acknowledged),
        Outcome::Refused(..) => None,
        Outcome::Unknown => Some(Fate::Unknown),
    }
}
