//! Tests bodies and how they are joined: solids, sheets, rigid bodies, ties, contact, equilibria, vibrations.

mod coming_to_rest;
mod consistent_mass;
mod contact;
mod contact_adaptive;
mod contact_at_end;
mod contact_bounces;
mod contact_cases;
mod contact_conformance;
mod contact_cuts;
mod contact_failures;
mod contact_impulses;
mod contact_planes;
mod contact_prescribed;
mod contact_reactions;
mod contact_resolved;
mod contact_scenes;
mod contact_statics;
mod contact_units;
mod equilibria;
mod filtered_mass;
mod mechanisms;
mod parts;
mod paths;
#[path = "../program/mod.rs"]
mod program;
mod rigid;
mod rigid_statics;
mod sheet_files;
mod sheets;
mod stiff_cloth;
mod stiff_parts;
mod strikes;
mod ties;
mod turning;
mod unheld;
mod vibrations;
