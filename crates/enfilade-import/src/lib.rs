//! enfilade-import
