//! The oracle column: why a session with a known object ends with another one or with "none of
//! these", told by what it would take to be right.
//!
//! A wrong session is repeated from the true pose. If the true object then has more evidence than
//! every other *and* "none of these" is less probable, the search lost it: by *refinement* if a
//! pose near the true one was left, else by *proposal*. Otherwise the true object and its strongest
//! rivals get a *map* of four times as many touches, then the *mesh* itself. If none of these
//! remedies helps, the *likelihood* is at fault where another object always has more evidence, and
//! the *background* (the evidence of "none of these", R13) where only that stands above the
//! object. "None of these" keeps the self-match scores of the catalogue's maps. Finer maps take
//! seconds each: sessions beyond a number stay *open*. A change of map decides anew whatever was
//! close, so that these shares are upper bounds.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::symmetry::Symmetry;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::{SurfaceMap, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use rayon::prelude::*;
use serde::Serialize;

use super::{Touched, Unknown, Verdict};
use crate::finer_maps::FinerMaps;
use crate::lost_sessions::{Cause, NEAR, RIVALS};
use crate::report::Report;

/// Numbers of touches after which sessions are examined, beside all of them.
const EXAMINED_AT: [usize; 3] = [4, 6, 10];

/// How far the true object is above its rivals (ln); below 0 it loses.
#[derive(Clone, Copy, Debug, Serialize)]
struct Margin {
    /// Its evidence less that of the strongest other object.
    object: f64,
    /// Its odds against "none of these".
    unknown: f64,
}

impl Margin {
    fn wins(&self) -> bool {
        self.object > 0.0 && self.unknown > 0.0
    }
}

/// A wrong session.
#[derive(Clone, Debug)]
pub(super) struct Lost {
    readings: usize,
    object: usize,
    trial: usize,
    /// Whether it named none of the objects.
    named_none: bool,
    /// By the search.
    found: Margin,
    /// Whether the search has left a pose near the true one.
    is_near: bool,
    /// From the true pose.
    search: Margin,
    /// From the true pose on maps of four times as many touches, and on the meshes.
    finer: Option<[Margin; 2]>,
    /// The strongest other objects, among those of the catalogue.
    rivals: Vec<usize>,
}

impl Lost {
    fn cause(&self) -> Cause {
        if self.search.wins() {
            return if self.is_near { Cause::Refinement } else { Cause::Proposal };
        }
        let Some([map, mesh]) = self.finer else { return Cause::Open };
        match (map.wins(), mesh.wins()) {
            (true, _) => Cause::Map,
            (false, true) => Cause::Mesh,
            // Some remedy puts the object above every other one.
            _ if [self.search, map, mesh].iter().any(|one| one.object > 0.0) => Cause::Background,
            _ => Cause::Likelihood,
        }
    }
}

/// A fold whose sessions are examined.
pub(super) struct Examined<'a> {
    pub(super) config: &'a Unknown,
    pub(super) touched: &'a Touched,
    pub(super) model: &'a Arc<SurfaceModel>,
    pub(super) options: SurfaceOptions,
}

/// A session repeated.
struct Repeated {
    belief: SurfaceBelief,
    session_from_object: Pose,
}

impl Examined<'_> {
    /// Repeats wrong sessions with known objects: at most `n` after each number of touches. Of
    /// those that the search did not lose, at most `n_finer` get finer maps.
    pub(super) fn lost(
        &self,
        verdicts: &[Verdict],
        n: usize,
        n_finer: usize,
    ) -> anyhow::Result<Vec<Lost>> {
        let mut all = Vec::new();
        for readings in EXAMINED_AT.into_iter().filter(|n| *n <= self.config.readings) {
            let is_lost = |v: &&Verdict| v.is_known && !v.stated(readings).is_right;
            let wrong: Vec<&Verdict> = verdicts.iter().filter(is_lost).collect();
            let lost = |verdict: &Verdict| self.repeated(verdict, readings);
            let found: anyhow::Result<Vec<_>> = spread(&wrong, n).map(|v| lost(v)).collect();
            let mut found: Vec<Lost> = found?.into_iter().flatten().collect();
            let open: Vec<usize> =
                (0..found.len()).filter(|at| found[*at].cause() == Cause::Open).collect();
            for at in spread(&open, n_finer) {
                found[*at].finer = self.on_finer_maps(&found[*at], verdicts)?;
            }
            all.extend(found);
        }
        Ok(all)
    }

    fn replay(&self, object: usize, trial: usize, readings: usize) -> anyhow::Result<Repeated> {
        let symmetries = vec![Symmetry::NONE; self.touched.objects.len()];
        let sessions = self.touched.sessions(self.config, &symmetries);
        let mut belief = SurfaceBelief::new(self.model.clone(), self.options, None)?;
        let mut session_from_object = Pose::IDENTITY;
        for heard in sessions.presented(object, trial).iter().take(readings) {
            belief.add(&heard.reading, &self.config.sensor);
            session_from_object = heard.session_from_object;
        }
        Ok(Repeated { belief, session_from_object })
    }

    /// A wrong session repeated from the true pose; `None` while neither pairs nor poses decide.
    fn repeated(&self, verdict: &Verdict, readings: usize) -> anyhow::Result<Option<Lost>> {
        let (object, trial) = (verdict.object, verdict.trial);
        let repeated = self.replay(object, trial, readings)?;
        let Repeated { belief, session_from_object } = &repeated;
        let evidence = belief.log_evidence();
        let place = verdict.truth;
        let mut rivals: Vec<usize> = (0..evidence.len()).filter(|at| *at != place).collect();
        rivals.sort_by(|a, b| evidence[*b].total_cmp(&evidence[*a]));
        rivals.truncate(RIVALS);
        let found = Margin {
            object: evidence[place] - evidence[rivals[0]],
            unknown: belief.log_odds_with(index(place), evidence[place]),
        };
        let is_near = belief.has_pose_near(index(place), session_from_object, NEAR.0, NEAR.1);
        let own = |at: usize| self.model.maps().get(at).map(|map| &**map);
        let Some(search) = repeated.margin(place, &rivals, own) else { return Ok(None) };
        let (named_none, finer) = (verdict.named(readings).is_none(), None);
        Ok(Some(Lost {
            readings,
            object,
            trial,
            named_none,
            found,
            is_near,
            search,
            finer,
            rivals,
        }))
    }

    /// The margins of a session on finer maps; `None` if an object cannot be touched that often.
    fn on_finer_maps(
        &self,
        lost: &Lost,
        verdicts: &[Verdict],
    ) -> anyhow::Result<Option<[Margin; 2]>> {
        // All sessions of the fold have the same catalogue.
        let Some(known) = verdicts.first().map(|verdict| &verdict.known) else { return Ok(None) };
        let Some(place) = known.iter().position(|at| *at == lost.object) else { return Ok(None) };
        let wanted: BTreeSet<usize> = lost.rivals.iter().copied().chain([place]).collect();
        let Unknown { sensor, train_readings, seed, .. } = self.config;
        let finer = |at: usize| {
            let (object, space) = (&self.touched.objects[known[at]], &self.model.space);
            Some((at, FinerMaps::of(object, sensor, space, *train_readings, 2 * *seed)?))
        };
        let finer: BTreeMap<usize, FinerMaps> = wanted.into_par_iter().filter_map(finer).collect();
        let repeated = self.replay(lost.object, lost.trial, lost.readings)?;
        let map = repeated.margin(place, &lost.rivals, |at| Some(&finer.get(&at)?.touched));
        let mesh = repeated.margin(place, &lost.rivals, |at| Some(&finer.get(&at)?.mesh));
        Ok(map.zip(mesh).map(|(map, mesh)| [map, mesh]))
    }
}

impl Repeated {
    /// The margin of an object of the catalogue from its true pose if these were the maps.
    fn margin<'m>(
        &self,
        object: usize,
        rivals: &[usize],
        map: impl Fn(usize) -> Option<&'m SurfaceMap>,
    ) -> Option<Margin> {
        let on =
            |at: usize, started: &[Pose]| self.belief.log_evidence_on(index(at), map(at)?, started);
        let own = on(object, &[self.session_from_object])?;
        let rivals: Option<Vec<f64>> = rivals.iter().map(|rival| on(*rival, &[])).collect();
        let strongest = rivals?.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let unknown = self.belief.log_odds_with(index(object), own);
        Some(Margin { object: own - strongest, unknown })
    }
}

fn index(object: usize) -> ObjectIdx {
    ObjectIdx(object as u32)
}

/// At most `n` of all, evenly spread.
fn spread<T>(all: &[T], n: usize) -> impl Iterator<Item = &T> {
    let n = n.min(all.len());
    (0..n).map(move |at| &all[at * all.len() / n])
}

/// The row of a wrong session.
#[derive(Serialize)]
struct Row {
    readings: usize,
    trial: usize,
    found_object: f64,
    found_unknown: f64,
    is_near: bool,
    search_object: f64,
    search_unknown: f64,
    map_object: Option<f64>,
    map_unknown: Option<f64>,
    mesh_object: Option<f64>,
    mesh_unknown: Option<f64>,
}

/// Adds a row for each wrong session, and the shares of the causes.
pub(super) fn report_lost(report: &mut Report, config: &Unknown, all: &[Lost]) {
    for lost in all {
        let named = if lost.named_none { "none of these" } else { "another object" };
        let labels = [("examined", "oracle"), ("cause", lost.cause().name()), ("named", named)];
        let [map, mesh] = [0, 1].map(|at| lost.finer.map(|finer| finer[at]));
        let row = Row {
            readings: lost.readings,
            trial: lost.trial,
            found_object: lost.found.object,
            found_unknown: lost.found.unknown,
            is_near: lost.is_near,
            search_object: lost.search.object,
            search_unknown: lost.search.unknown,
            map_object: map.map(|margin| margin.object),
            map_unknown: map.map(|margin| margin.unknown),
            mesh_object: mesh.map(|margin| margin.object),
            mesh_unknown: mesh.map(|margin| margin.unknown),
        };
        report.labelled(&labels, row);
    }
    for readings in EXAMINED_AT.into_iter().filter(|n| *n <= config.readings) {
        let examined: Vec<&Lost> = all.iter().filter(|lost| lost.readings == readings).collect();
        let n = examined.len() as f64;
        report.summarise(&format!("examined_at_{readings}"), n);
        if examined.is_empty() {
            continue;
        }
        let share =
            |of: &dyn Fn(&Lost) -> bool| examined.iter().filter(|lost| of(lost)).count() as f64 / n;
        report.summarise(
            &format!("lost_to_none_of_these_at_{readings}"),
            share(&|lost| lost.named_none),
        );
        for cause in Cause::ALL {
            let key = format!("lost_by_{}_at_{readings}", cause.name());
            report.summarise(&key, share(&|lost| lost.cause() == cause));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_remedy_that_makes_a_session_right_is_its_cause() {
        let of = |[object, unknown]: [f64; 2]| Margin { object, unknown };
        let lost = |is_near, [search, map, mesh]: [[f64; 2]; 3]| Lost {
            readings: 4,
            object: 0,
            trial: 0,
            named_none: false,
            found: of([-1.0, -1.0]),
            is_near,
            search: of(search),
            finer: Some([of(map), of(mesh)]),
            rivals: vec![1],
        };
        let (wins, below_none, loses) = ([0.1, 0.1], [0.1, -0.1], [-0.1, 0.1]);
        assert_eq!(lost(false, [wins; 3]).cause(), Cause::Proposal);
        assert_eq!(lost(true, [wins; 3]).cause(), Cause::Refinement);
        assert_eq!(lost(true, [below_none, wins, loses]).cause(), Cause::Map);
        assert_eq!(lost(true, [loses, below_none, wins]).cause(), Cause::Mesh);
        assert_eq!(lost(true, [loses, loses, below_none]).cause(), Cause::Background);
        assert_eq!(lost(true, [loses; 3]).cause(), Cause::Likelihood);
        assert_eq!(Lost { finer: None, ..lost(true, [loses; 3]) }.cause(), Cause::Open);
    }

    #[test]
    fn examined_sessions_are_spread_over_all() {
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(spread(&all, 3).collect::<Vec<_>>(), [&0, &3, &6]);
        assert_eq!(spread(&all, 20).count(), 10);
        assert_eq!(spread(&all, 0).count(), 0);
    }
}
