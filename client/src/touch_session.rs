//! A robot's part in a session. It numbers the robot's readings, so that a repeated reading is not
//! counted twice, and stamps them, so that the readings of several robots are folded in the order
//! in which they were taken.

use palpate_schemas::{
    AddReadings, AskNextTouches, Belief, BeliefDetail, Contact, CreateSession, NextTouches, Pose,
    Reading, ReadingsQuery, Session, Stamp,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::stamps::Stamps;

/// One robot's readings in one session.
#[derive(Clone, Debug)]
pub struct TouchSession {
    client: Client,
    session: Session,
    robot: String,
    next_seq: u64,
    stamps: Stamps,
}

/// One press, or one contact without an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Touch {
    /// Id or name of the sensor.
    pub sensor: String,
    /// `session_from_sensor`; `None` if the session's method needs no poses.
    pub pose: Option<Pose>,
    /// Pressures in pascal, as the driver sends them; empty for a contact without an image.
    pub image: Vec<Option<f64>>,
    /// A contact without an image, which has its own position and no `pose`.
    pub contact: Option<Contact>,
    /// Shear of three-axis taxels in pascal, two values for each taxel of the image.
    pub shear: Option<Vec<Option<[f64; 2]>>>,
    /// Distance in metres that the sensor travelled along its +z without contact; important for a
    /// press that met nothing.
    pub approach_m: Option<f64>,
    /// Time of the press, by a clock shared by all robots of the session, such as the simulated
    /// time. It must increase with every touch. Default: this computer's clock.
    pub stamp: Option<Stamp>,
}

impl Client {
    /// Creates a session for one robot. `robot` is its name, at most 64 bytes.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn touch_session(
        &self,
        session: &CreateSession,
        robot: &str,
    ) -> Result<TouchSession, Error> {
        let session = self.create_session(session).await?;
        Ok(TouchSession::join(self.clone(), session, robot, 0))
    }
}

impl TouchSession {
    /// Joins an existing session; `next_seq` is the robot's next number in it.
    #[must_use]
    pub fn join(client: Client, session: Session, robot: &str, next_seq: u64) -> Self {
        let stamps = Stamps::default();
        Self { client, session, robot: robot.to_owned(), next_seq, stamps }
    }

    /// The session as it was when it was created or joined.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Id of the session.
    #[must_use]
    pub fn id(&self) -> Uuid {
        self.session.id
    }

    /// Sends one press and returns the belief after it. `sensor` is an id or a name, `pose` is
    /// `session_from_sensor` (`None::<Pose>` if the session's method needs none), `image` in pascal
    /// as the driver sends it.
    ///
    /// A failed call may be repeated with the same arguments: it keeps its number and stamp.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn touch(
        &mut self,
        sensor: &str,
        pose: impl Into<Option<Pose>>,
        image: Vec<Option<f64>>,
    ) -> Result<Belief, Error> {
        self.touch_after(sensor, pose, image, None).await
    }

    /// Like [`TouchSession::touch`], after `approach_m` metres of travel along the sensor's +z
    /// without contact; important for a press that met nothing.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn touch_after(
        &mut self,
        sensor: &str,
        pose: impl Into<Option<Pose>>,
        image: Vec<Option<f64>>,
        approach_m: Option<f64>,
    ) -> Result<Belief, Error> {
        let (sensor, pose) = (sensor.to_owned(), pose.into());
        self.send(Touch { sensor, pose, image, approach_m, ..Touch::default() }).await
    }

    /// Sends one contact without an image, as a bumper, a force–torque sensor or a single taxel
    /// feels it, and returns the belief after it.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn feel(&mut self, sensor: &str, contact: Contact) -> Result<Belief, Error> {
        let (sensor, contact) = (sensor.to_owned(), Some(contact));
        self.send(Touch { sensor, contact, ..Touch::default() }).await
    }

    /// Like [`TouchSession::touch`], with all properties of a press.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn send(&mut self, touch: Touch) -> Result<Belief, Error> {
        let stamp = match touch.stamp {
            Some(stamp) => stamp,
            None => self.stamps.of(self.next_seq),
        };
        let reading = Reading {
            robot: Some(self.robot.clone()),
            seq: Some(self.next_seq),
            sensor: touch.sensor,
            frame_id: self.session.frame_id.clone(),
            stamp: Some(stamp),
            pose: touch.pose,
            image: touch.image,
            feature: None,
            approach_m: touch.approach_m,
            object_moved: None,
            contact: touch.contact,
            shear: touch.shear,
        };
        let readings = AddReadings { readings: vec![reading] };
        let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
        let added = match self.client.add_readings(self.id(), &readings, query).await {
            Ok(added) => added,
            Err(error) => {
                // A refused press is not stored, so the next one gets its own stamp.
                if error.status().is_some_and(|status| status < 500) {
                    self.stamps.forget();
                }
                return Err(error);
            }
        };
        self.next_seq += 1;
        match added.belief {
            Some(belief) => Ok(belief),
            None => self.belief().await,
        }
    }

    /// Ranks the next touches.
    ///
    /// # Errors
    /// [`Error`]; status 409 as in [`Client::next_touches`].
    pub async fn next_touches(&self, question: &AskNextTouches) -> Result<NextTouches, Error> {
        self.client.next_touches(self.id(), question).await
    }

    /// Returns the current belief.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn belief(&self) -> Result<Belief, Error> {
        self.client.belief(self.id(), palpate_schemas::BeliefQuery::default()).await
    }
}
