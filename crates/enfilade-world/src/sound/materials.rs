//! Absorption of surfaces by the names of their materials.
//!
//! Coefficients at random incidence in octave bands: Vorländer, "Auralization" (2008), annex, but for lawns and soil, which are
//! Egan's, "Architectural Acoustics" (1988). A model rarely says more than a word, and IFC often no more than the class of an
//! element: what follows is what is built most, and [`Assumed::is_guess`] tells where not even a word was known.

use crate::sound::bands::N_BANDS;

/// Absorption assumed for a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumed {
    /// The surface of the table, in words.
    pub surface: &'static str,
    /// Absorption coefficients in the [octave bands](crate::OCTAVES), 0 to 1.
    pub bands: [f64; N_BANDS],
    /// `true` if no word of the name was known, so that hard walls are assumed.
    pub is_guess: bool,
}

/// A surface, words of materials in English, German and French, and IFC classes that have it.
struct Surface {
    name: &'static str,
    bands: [f64; N_BANDS],
    /// Words of up to four letters match whole words, longer ones parts of words, too.
    words: &'static [&'static str],
    classes: &'static [&'static str],
}

/// The first that fits counts.
const SURFACES: [Surface; 20] = [
    Surface {
        name: "fissured ceiling tile",
        bands: [0.49, 0.53, 0.53, 0.75, 0.92, 0.99],
        words: &[
            "acoustic",
            "akusti",
            "acoustique",
            "mineralfaser",
            "ceiling tile",
            "absorb",
        ],
        classes: &[],
    },
    Surface {
        name: "mineral wool, 50 mm",
        bands: [0.15, 0.70, 0.60, 0.60, 0.85, 0.90],
        words: &[
            "wool",
            "rockwool",
            "insulation",
            "dämm",
            "daemm",
            "isolant",
            "foam",
            "schaum",
        ],
        classes: &[],
    },
    Surface {
        name: "curtains, 0.2 kg/m²",
        bands: [0.05, 0.06, 0.39, 0.63, 0.70, 0.73],
        words: &[
            "curtain", "drape", "vorhang", "rideau", "fabric", "textil", "cloth", "stoff", "velvet",
        ],
        classes: &[],
    },
    Surface {
        name: "carpet, 6 mm, bonded",
        bands: [0.03, 0.09, 0.25, 0.31, 0.33, 0.44],
        words: &["carpet", "teppich", "moquette", "tapis", "rug", "rugs"],
        classes: &[],
    },
    Surface {
        name: "chairs upholstered with cloth",
        bands: [0.44, 0.60, 0.77, 0.89, 0.82, 0.70],
        words: &[
            "upholster",
            "polster",
            "sofa",
            "couch",
            "cushion",
            "mattress",
            "matratze",
        ],
        classes: &[],
    },
    Surface {
        name: "chairs of wood",
        bands: [0.05, 0.08, 0.10, 0.12, 0.12, 0.12],
        words: &["furniture", "furnishing", "möbel", "moebel", "mobilier"],
        classes: &["furniture", "furnishingelement", "systemfurnitureelement"],
    },
    Surface {
        name: "double glazing, 10 mm gap",
        bands: [0.10, 0.07, 0.05, 0.03, 0.02, 0.02],
        words: &[
            "glass", "glazing", "glazed", "verglas", "glas", "verre", "vitr", "window", "fenster",
            "pane",
        ],
        classes: &["window", "plate", "curtainwall"],
    },
    Surface {
        name: "door of solid wood",
        bands: [0.14, 0.10, 0.06, 0.08, 0.10, 0.10],
        words: &["door", "tür", "tuer", "porte"],
        classes: &["door"],
    },
    Surface {
        name: "plasterboard ceiling",
        bands: [0.20, 0.15, 0.10, 0.08, 0.04, 0.02],
        words: &["ceiling", "plafond", "deckenplatte", "abgehängt"],
        classes: &["covering", "roof"],
    },
    Surface {
        name: "plasterboard on steel frame",
        bands: [0.15, 0.10, 0.06, 0.04, 0.04, 0.05],
        words: &[
            "gypsum",
            "plasterboard",
            "drywall",
            "gipskarton",
            "gipsplatte",
            "gips",
            "trockenbau",
            "placo",
            "plâtre",
        ],
        classes: &[],
    },
    Surface {
        name: "linoleum on concrete",
        bands: [0.02, 0.03, 0.03, 0.03, 0.03, 0.02],
        words: &[
            "linoleum", "vinyl", "rubber", "gummi", "cork", "asphalt", "pvc",
        ],
        classes: &[],
    },
    Surface {
        name: "wooden floor",
        bands: [0.09, 0.06, 0.05, 0.05, 0.05, 0.04],
        words: &[
            "parquet",
            "parkett",
            "laminate",
            "laminat",
            "floorboard",
            "dielen",
        ],
        classes: &[],
    },
    Surface {
        name: "wood, 16 mm on studs",
        bands: [0.18, 0.12, 0.10, 0.09, 0.08, 0.07],
        words: &[
            "wood",
            "timber",
            "holz",
            "bois",
            "oak",
            "pine",
            "beech",
            "spruce",
            "fichte",
            "buche",
            "eiche",
            "plywood",
            "chipboard",
            "spanplatte",
            "mdf",
            "osb",
        ],
        classes: &[],
    },
    Surface {
        name: "lawn",
        bands: [0.11, 0.26, 0.60, 0.69, 0.92, 0.99],
        words: &["grass", "lawn", "rasen", "gazon", "pelouse"],
        classes: &[],
    },
    Surface {
        name: "rough soil",
        bands: [0.15, 0.25, 0.40, 0.55, 0.60, 0.60],
        words: &[
            "soil", "earth", "erde", "terrain", "gravel", "kies", "sand", "terre",
        ],
        classes: &["site", "geographicelement"],
    },
    Surface {
        name: "ceramic tiles",
        bands: [0.01, 0.01, 0.01, 0.02, 0.02, 0.02],
        words: &[
            "tile",
            "tiles",
            "fliese",
            "keramik",
            "ceramic",
            "carrelage",
            "porcelain",
        ],
        classes: &["sanitaryterminal"],
    },
    Surface {
        name: "marble floor",
        bands: [0.01, 0.01, 0.01, 0.02, 0.02, 0.02],
        words: &["marble", "marmor", "marbre", "granit", "terrazzo"],
        classes: &[],
    },
    Surface {
        name: "brickwork, rendered",
        bands: [0.01, 0.02, 0.02, 0.03, 0.03, 0.04],
        words: &[
            "brick",
            "ziegel",
            "masonry",
            "mauerwerk",
            "brique",
            "plaster",
            "putz",
            "stucco",
            "render",
            "enduit",
        ],
        classes: &[],
    },
    Surface {
        name: "concrete, smooth, unpainted",
        bands: [0.01, 0.01, 0.02, 0.02, 0.02, 0.05],
        words: &[
            "concrete", "beton", "béton", "cement", "zement", "screed", "estrich", "stone",
            "stein", "pierre",
        ],
        classes: &[
            "footing",
            "stair",
            "stairflight",
            "ramp",
            "rampflight",
            "column",
            "beam",
            "pile",
        ],
    },
    Surface {
        name: HARD_NAME,
        bands: HARD,
        words: &[
            "wall", "wand", "mur", "metal", "metall", "steel", "stahl", "acier", "alumin", "paint",
            "farbe",
        ],
        classes: &[
            "wall",
            "wallstandardcase",
            "wallelementedcase",
            "slab",
            "member",
            "railing",
        ],
    },
];

const HARD_NAME: &str = "hard walls and floors, the mean";
const HARD: [f64; N_BANDS] = [0.02, 0.02, 0.03, 0.03, 0.04, 0.05];

impl Assumed {
    /// Returns what is assumed for the name of a material, in any case: `Oak parquet`, `IfcSlab`, `STB_Stahlbeton`.
    #[must_use]
    pub fn of_name(name: &str) -> Self {
        let name = name.to_lowercase();
        let class = name.trim().strip_prefix("ifc");
        let has_word = |word: &&str| {
            if word.chars().count() > 4 {
                return name.contains(*word);
            }
            name.split(|c: char| !c.is_alphabetic()).any(|w| w == *word)
        };
        let fits = |surface: &&Surface| match class {
            Some(class) => surface.classes.contains(&class),
            None => surface.words.iter().any(&has_word),
        };
        match SURFACES.iter().find(fits) {
            Some(surface) => Self {
                surface: surface.name,
                bands: surface.bands,
                is_guess: false,
            },
            None => Self {
                surface: HARD_NAME,
                bands: HARD,
                is_guess: true,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W11.
    #[test]
    fn materials_are_known_by_words_and_classes() {
        for (name, surface) in [
            ("IfcSlab", HARD_NAME),
            ("IFCWALLSTANDARDCASE", HARD_NAME),
            ("IfcWindow", "double glazing, 10 mm gap"),
            ("IfcDoor", "door of solid wood"),
            ("IfcCovering", "plasterboard ceiling"),
            ("IfcFurnishingElement", "chairs of wood"),
            ("Oak_Parquet", "wooden floor"),
            ("STB Stahlbeton C25/30", "concrete, smooth, unpainted"),
            ("Teppichboden grau", "carpet, 6 mm, bonded"),
            ("Wood panel", "wood, 16 mm on studs"),
            ("béton brut", "concrete, smooth, unpainted"),
            ("Gipskartonplatte", "plasterboard on steel frame"),
        ] {
            let found = Assumed::of_name(name);
            assert_eq!((found.surface, found.is_guess), (surface, false), "{name}");
        }
        let unknown = Assumed::of_name("Material.001");
        assert!(unknown.is_guess && unknown.bands == HARD);
        assert!(Assumed::of_name("IfcBuildingElementProxy").is_guess);
        // Not a pane, not a rug.
        assert!(Assumed::of_name("panel drug").is_guess);
    }

    /// W11.
    #[test]
    fn coefficients_are_between_none_and_all() {
        for surface in &SURFACES {
            assert!(
                surface.bands.iter().all(|a| (0.0..=1.0).contains(a)),
                "{}",
                surface.name
            );
        }
    }
}
