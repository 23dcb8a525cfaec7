//! `enfilade export --rooms-solid`: each room as a closed mesh.

use enfilade::world::Assumed;
use enfilade_export::room_solids;

use crate::export::{Export, check_rooms, read_valid, write_files};
use crate::output::{Outputs, check_folder, refuse_stream};

/// The file that says which others there are; no room has this name.
const LIST: &str = "_rooms.json";

pub(super) fn run(args: &Export, outputs: &Outputs) -> anyhow::Result<()> {
    refuse_stream("-o", &args.output, "a folder")?;
    check_folder("-o", &args.output, LIST)?;
    let world = read_valid(args)?;
    check_rooms(&world)?;
    let solids = room_solids(&world, &|name| Assumed::of_name(name).bands);
    let rooms = solids.iter().map(|s| {
        serde_json::json!({
            "cell": s.cell.0,
            "name": world.graph[s.cell].name,
            "file": s.name,
            "volume": s.volume,
        })
    });
    let list = serde_json::json!({ "rooms": rooms.collect::<Vec<_>>() });
    let list = (LIST.to_owned(), (list.to_string() + "\n").into_bytes());
    let files = solids.iter().flat_map(|solid| {
        let name = |ending: &str| format!("{}.{ending}", solid.name);
        [
            (name("obj"), solid.obj().into_bytes()),
            (name("stl"), solid.stl()),
            (name("json"), solid.acoustics_json().into_bytes()),
        ]
    });
    write_files(args, outputs, std::iter::once(list).chain(files))
}
