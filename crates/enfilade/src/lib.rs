//! enfilade
