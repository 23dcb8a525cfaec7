//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../../../enfilade-cpg/tests/common/mod.rs"]
mod cpg_common;
#[path = "../pictured/mod.rs"]
mod pictured;
#[path = "../../../enfilade-verify/tests/common/mod.rs"]
mod verify_common;

mod bad_input;
mod bad_pictures;
mod budgets;
mod cli;
mod costs;
mod doorless;
mod evidence;
mod export;
mod facts;
mod habits;
mod jobs;
mod kits;
mod limits;
mod living;
mod maps;
mod marks;
mod mirrors;
mod name;
mod objects;
mod order;
mod outputs;
mod pack;
mod path;
mod pictures;
mod plans;
mod portals;
mod pvs;
mod repair;
mod report_page;
mod screen;
mod see;
mod serve;
mod silence;
mod sound;
mod source_limits;
mod streamed_pictures;
mod streamed_walk;
mod streams;
mod tables;
mod textured_pictures;
mod trades;
mod verdict;
mod verify;
