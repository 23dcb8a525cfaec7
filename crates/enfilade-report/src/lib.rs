//! Reports on enfilade worlds for people: floor plans as SVG.
