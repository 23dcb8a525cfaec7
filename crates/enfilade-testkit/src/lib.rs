//! enfilade-testkit
