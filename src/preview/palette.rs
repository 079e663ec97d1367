//! Colours of materials.

use super::rgb;
use crate::math::DVec3;
use crate::scene::Scene;

/// A colour that stays with the material: by a word in its name if we know one,
/// else from a wheel of muted tones.
pub(super) fn material_colour(scene: &Scene, material: u32) -> DVec3 {
    const KNOWN: &[(&str, [u8; 3])] = &[
        ("grass", [128, 148, 92]),
        ("dirt", [166, 138, 104]),
        ("snow", [228, 233, 238]),
        ("rock", [142, 132, 122]),
        ("sand", [205, 182, 140]),
        ("water", [92, 138, 158]),
        ("asphalt", [98, 100, 106]),
        ("pavement", [176, 174, 168]),
        ("concrete", [178, 174, 166]),
        ("brick", [164, 96, 78]),
        ("plaster", [222, 210, 188]),
        ("wood", [150, 112, 74]),
        ("plank", [172, 134, 92]),
        ("metal", [126, 138, 148]),
        ("rust", [158, 104, 70]),
        ("roof", [122, 76, 66]),
        ("slate", [88, 98, 112]),
        ("glass", [150, 190, 205]),
        ("foliage", [84, 118, 74]),
        ("pine", [66, 98, 78]),
        ("frosted", [158, 182, 176]),
        ("road", [182, 152, 114]),
        ("bark", [104, 80, 62]),
        ("red", [184, 74, 64]),
        ("blue", [82, 116, 164]),
        ("coal", [58, 56, 58]),
        ("tile", [196, 188, 176]),
        ("carpet", [140, 92, 96]),
        ("paper", [236, 230, 214]),
        ("lamp", [246, 226, 160]),
        ("trim", [112, 92, 74]),
        ("hay", [212, 180, 98]),
        ("fabric", [116, 136, 120]),
        ("black", [52, 54, 58]),
        ("gold", [214, 172, 72]),
        ("white", [232, 230, 224]),
        ("paint", [138, 154, 138]),
    ];
    let name = scene.material_names.get(material as usize).map(|n| n.to_lowercase()).unwrap_or_default();
    // The first word that we know says what it is made of: `snow_roof` is white.
    let known = KNOWN.iter().filter_map(|(word, c)| Some((name.find(word)?, usize::MAX - word.len(), c)));
    if let Some((_, _, c)) = known.min() {
        return rgb(*c);
    }
    // Steps by the golden angle: neighbours in number are far apart in hue.
    let hue = f64::from(material) * 2.399_963;
    let wave = |shift: f64| 0.62 + 0.16 * libm::cos(hue + shift);
    DVec3::new(wave(0.0), wave(-2.094), wave(2.094))
}
