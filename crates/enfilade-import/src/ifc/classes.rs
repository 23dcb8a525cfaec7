//! Classes of the instances in a STEP file, in the schema's spelling.

use std::collections::HashMap;

/// Characters of a global id.
const GUID_LENGTH: usize = 22;

/// Returns `true` for a global id of IFC: 22 characters of its base 64.
pub(crate) fn is_guid(text: &str) -> bool {
    let is_digit = |c: u8| c.is_ascii_alphanumeric() || c == b'_' || c == b'$';
    text.len() == GUID_LENGTH && text.bytes().all(is_digit)
}

/// Returns the new name of a node that IfcConvert called by its global id: `IfcWall/0iEHWY1$XA8eQeeULq4jE6`.
pub(super) fn renamed(name: &str, classes: &HashMap<String, String>) -> Option<String> {
    // Some versions write `product-GUID-body`.
    let guid = name.strip_prefix("product-").unwrap_or(name);
    let guid = guid.get(..GUID_LENGTH)?;
    Some(format!("{}/{guid}", classes.get(guid)?))
}

/// Returns the class, as `IFCWALL`, of each instance by global id: `#12=IFCWALL('...',`. Linear.
pub(super) fn classes(bytes: &[u8]) -> HashMap<String, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut classes = HashMap::new();
    for instance in text.split(';') {
        let Some((_, rest)) = instance.split_once('=') else {
            continue;
        };
        let Some((class, rest)) = rest.split_once('(') else {
            continue;
        };
        let class = class.trim();
        let guid = rest.trim_start().strip_prefix('\'');
        let guid = guid.and_then(|g| g.split_once('\'')).map(|g| g.0);
        if let Some(guid) = guid.filter(|g| g.len() == GUID_LENGTH)
            && let Some(kind) = class.to_ascii_uppercase().strip_prefix("IFC")
        {
            classes.insert(guid.to_owned(), format!("Ifc{}", capitalized(kind)));
        }
    }
    classes
}

/// Words in the names of classes that have a shape.
const WORDS: [&str; 61] = [
    "Air",
    "Annotation",
    "Assembly",
    "Beam",
    "Building",
    "Built",
    "Case",
    "Chimney",
    "Civil",
    "Column",
    "Controller",
    "Conversion",
    "Covering",
    "Curtain",
    "Device",
    "Discrete",
    "Distribution",
    "Door",
    "Electric",
    "Element",
    "Elemented",
    "Energy",
    "Equipment",
    "Feature",
    "Fitting",
    "Fixture",
    "Flight",
    "Flow",
    "Footing",
    "Furnishing",
    "Furniture",
    "Geographic",
    "Grid",
    "Lamp",
    "Light",
    "Member",
    "Opening",
    "Outlet",
    "Pile",
    "Plate",
    "Proxy",
    "Railing",
    "Ramp",
    "Roof",
    "Sanitary",
    "Segment",
    "Shading",
    "Site",
    "Slab",
    "Space",
    "Spatial",
    "Stair",
    "Standard",
    "Switching",
    "System",
    "Terminal",
    "Transport",
    "Virtual",
    "Wall",
    "Window",
    "Zone",
];

/// Returns `WALLSTANDARDCASE` in the schema's spelling; STEP files have capitals only. Unknown words stay one word.
fn capitalized(kind: &str) -> String {
    let mut out = String::new();
    let mut rest = kind;
    while !rest.is_empty() {
        let is_next = |w: &&&str| {
            rest.get(..w.len())
                .is_some_and(|r| r.eq_ignore_ascii_case(w))
        };
        let found = WORDS.iter().filter(is_next).max_by_key(|w| w.len());
        let n = found.map_or(rest.len(), |w| w.len());
        let (first, tail) = rest[..n].split_at_checked(1).unwrap_or((rest, ""));
        out += first;
        out += &tail.to_ascii_lowercase();
        rest = &rest[n..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_read_by_global_id() {
        let text = b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC4'));ENDSEC;DATA;\n\
            #1= IFCWALLSTANDARDCASE('0iEHWY1$XA8eQeeULq4jE6',#2,'a;b');\n\
            #2=IFCCARTESIANPOINT((0.,0.));#3=IFCDOOR ( '1iEHWY1$XA8eQeeULq4jE6' ,$);#4=IFC('2iEHWY1$XA8eQeeULq4jE6');";
        let classes = classes(text);
        assert_eq!(classes["0iEHWY1$XA8eQeeULq4jE6"], "IfcWallStandardCase");
        assert_eq!(classes["1iEHWY1$XA8eQeeULq4jE6"], "IfcDoor");
        assert_eq!(classes["2iEHWY1$XA8eQeeULq4jE6"], "Ifc");
        assert_eq!(classes.len(), 3);
    }

    #[test]
    fn classes_that_roles_know_are_written_as_they_know_them() {
        for class in enfilade_prepare::ifc_classes() {
            let upper = class["Ifc".len()..].to_ascii_uppercase();
            assert_eq!(format!("Ifc{}", capitalized(&upper)), class);
        }
        assert_eq!(capitalized("CURTAINWALL"), "CurtainWall");
        assert_eq!(capitalized("ODDTHING"), "Oddthing");
    }
}
