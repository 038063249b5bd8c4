//! `palpate maps`: show, export and merge contact maps.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Subcommand};
use palpate_client::schemas::{
    CatalogueVersion, MergeMaps, OccupancyMap, PlyForm, SliceQuery, VersionReference,
};
use serde::Serialize;

use super::Context;
use crate::output;

/// Arguments of `palpate maps`.
#[derive(Debug, Args)]
pub(crate) struct MapsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Show an object's contact map: its cells, and how many are occupied.
    Show {
        #[command(flatten)]
        map: MapArgs,
    },
    /// Write an object's contact map to files.
    #[command(after_help = "Example:\n  palpate maps export --object A --png A.png\n  \
        palpate maps export --object mug --ply mug-map.ply --form mesh")]
    Export(ExportArgs),
    /// Merge the contact maps of another version into a new version of a catalogue.
    #[command(
        after_help = "Example:\n  palpate maps merge --with-catalogue lab-2 --with-version 3"
    )]
    Merge(MergeArgs),
}

/// Selects a map.
#[derive(Debug, Args)]
struct MapArgs {
    /// Name of the catalogue.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Version of the catalogue [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
    /// Id of the object, or its name when it was trained.
    #[arg(long)]
    object: String,
}

#[derive(Debug, Args)]
struct ExportArgs {
    #[command(flatten)]
    map: MapArgs,
    /// Write a heat map of one layer of cells (PNG).
    #[arg(long, value_name = "FILE", required_unless_present = "ply")]
    png: Option<PathBuf>,
    /// Layer, from 0 at the smallest z [default: the middle one].
    #[arg(long, requires = "png")]
    slice: Option<u32>,
    /// Write the likely occupied cells, in metres in the object frame (PLY).
    #[arg(long, value_name = "FILE")]
    ply: Option<PathBuf>,
    /// Content of the PLY file.
    #[arg(long, value_enum, default_value = "points")]
    form: PlyForm,
}

#[derive(Debug, Args)]
struct MergeArgs {
    /// Catalogue of the base version.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Base version [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
    /// Catalogue of the maps to add [default: the same].
    #[arg(long)]
    with_catalogue: Option<String>,
    /// Version of the maps to add.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    with_version: u32,
    /// Do not make the new version current.
    #[arg(long)]
    keep_current: bool,
}

/// The files written.
#[derive(Debug, Serialize)]
struct Exported {
    files: Vec<PathBuf>,
}

/// Runs the command.
pub(crate) async fn run(args: MapsArgs, context: &Context) -> anyhow::Result<()> {
    match args.action {
        Action::Show { map } => {
            let version = version_of(&map, context).await?;
            let query = SliceQuery::default();
            let client = &context.client;
            let map = client.occupancy(&map.catalogue, version, &map.object, query).await?;
            context.output.answer(&map, map_words)
        }
        Action::Export(args) => export(args, context).await,
        Action::Merge(args) => {
            let with = VersionReference {
                catalogue: args.with_catalogue.unwrap_or_else(|| args.catalogue.clone()),
                version: args.with_version,
            };
            let merge =
                MergeMaps { version: args.version, with, activate: Some(!args.keep_current) };
            let version = context.client.merge_maps(&args.catalogue, &merge).await?;
            context.output.answer(&version, merged_words)
        }
    }
}

async fn export(args: ExportArgs, context: &Context) -> anyhow::Result<()> {
    let version = version_of(&args.map, context).await?;
    let (client, MapArgs { catalogue, object, .. }) = (&context.client, &args.map);
    let mut files = Vec::new();
    if let Some(path) = args.png {
        let query = SliceQuery { slice: args.slice };
        write(&path, &client.occupancy_png(catalogue, version, object, query).await?)?;
        files.push(path);
    }
    if let Some(path) = args.ply {
        write(&path, &client.occupancy_ply(catalogue, version, object, args.form).await?)?;
        files.push(path);
    }
    context.output.answer(&Exported { files }, |exported| {
        let written = |path: &PathBuf| format!("wrote {}", path.display());
        exported.files.iter().map(written).collect::<Vec<_>>().join("\n")
    })
}

/// The version named, or the catalogue's current one.
async fn version_of(map: &MapArgs, context: &Context) -> anyhow::Result<u32> {
    match map.version {
        Some(version) => Ok(version),
        None => Ok(context.client.current_version(&map.catalogue).await?.version),
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn map_words(map: &OccupancyMap) -> String {
    let [x, y, z] = map.n_cells;
    let kind = output::word(&map.kind);
    format!(
        "{}: {kind}, {x} × {y} × {z} cells of {}, {} occupied, {} free, {} unknown{}",
        map.name,
        output::mm(map.cell),
        map.n_occupied,
        map.n_free,
        map.n_unknown,
        if map.has_force { ", with pressures" } else { "" }
    )
}

fn merged_words(version: &CatalogueVersion) -> String {
    let from: Vec<String> = version
        .merged_from
        .iter()
        .map(|from| format!("version {} of {}", from.version, from.catalogue))
        .collect();
    format!(
        "made version {} of {} from {}{}",
        version.version,
        version.catalogue,
        from.join(" and "),
        if version.is_current { ", current" } else { "" }
    )
}
