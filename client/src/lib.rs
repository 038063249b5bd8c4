//! Client of Palpate's HTTP API: typed calls, with retries where they are safe.
//!
//! A [`Client`] is cheap to clone and meant to be kept. Types of requests and answers are
//! those of `palpate_schemas`, all SI, quaternions x, y, z, w. A robot opens a
//! [`TouchSession`], which numbers its readings so that none is counted twice, and stamps them.
//!
//! ```no_run
//! # async fn example() -> Result<(), palpate_client::Error> {
//! use palpate_client::{Client, schemas::{CreateSession, Pose, Reading}};
//!
//! let client = Client::new("http://127.0.0.1:7411")?;
//! let mut session = client.touch_session(&CreateSession::default(), "arm-3").await?;
//! let pose = Pose { position: [0.4, -0.1, 0.25], orientation: [0.0, 0.0, 0.0, 1.0] };
//! let image = vec![Some(1200.0); 36];
//! let belief = session.touch("digitacts-6x6", pose, image).await?;
//! println!("{} with {}", belief.objects[0].name, belief.objects[0].probability);
//! # Ok(())
//! # }
//! ```

mod error;
mod retry;
mod request;
mod client;
mod sensors;
mod objects;
mod training;
mod maps;
mod keys;
mod compactions;
mod snapshots;
mod storage;
mod webhooks;
mod history;
mod sessions;
mod fleet;
mod forwarding;
mod labels;
mod stamps;
mod events;
mod touch_session;

pub use client::{Client, ClientOptions};
pub use error::Error;
pub use events::Events;
/// Types of requests and answers.
pub use palpate_schemas as schemas;
pub use retry::RetryPolicy;
pub use touch_session::{Touch, TouchSession};
