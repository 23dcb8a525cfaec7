//! enfilade-runtime
