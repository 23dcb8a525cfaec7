//! enfilade-bake
