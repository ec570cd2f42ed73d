//! Hostile lines of scripts of edits.

/// Lines of a script with something hostile in the place of every value, one at a time, and cut off everywhere.
pub fn lines() -> Vec<String> {
    const LINES: [&str; 10] = [
        r#"{"do": "transform", "node": "quad", "translation": [@, 0, 0], "rotation": [0, @, 0, 1], "scale": [1, 1, @]}"#,
        r#"{"do": "transform", "node": @, "translation": @, "rotation": @, "scale": @}"#,
        r#"{"do": "light", "node": "lamp", "intensity": @, "color": [1, @, 1], "spot": {"innerConeAngle": @, "outerConeAngle": @}}"#,
        r#"{"do": "light", "node": @, "color": @, "spot": @}"#,
        r#"{"do": "material", "material": 0, "baseColorFactor": [0, @, 0, @], "emissiveFactor": [@, 0, 0], "emissiveStrength": @}"#,
        r#"{"do": "material", "material": @, "baseColorFactor": @, "emissiveFactor": @, @: 1}"#,
        r#"{"do": "add", "file": @, "name": @, "parent": @}"#,
        r#"{"do": "copy", "node": @, "name": @}"#,
        r#"{"do": "remove", "node": @}"#,
        r#"{"do": @, @: @}"#,
    ];
    const VALUES: [&str; 22] = [
        "1e999",
        "-1e999",
        "1e308",
        "-3e38",
        "1e-46",
        "-0.0",
        "NaN",
        "null",
        "true",
        "[]",
        "{}",
        "-1",
        "4294967296",
        "18446744073709551616",
        "\"\"",
        "\"node 0\"",
        "\"\\u0000\\n\"",
        "\"..\"",
        "\"/dev/zero\"",
        "\"scene.glb\"",
        "\"\u{202e}\u{1f4a1}\"",
        "[[[[[[[[]]]]]]]]",
    ];
    let mut hostile = Vec::new();
    for line in LINES {
        let places: Vec<usize> = line.match_indices('@').map(|(at, _)| at).collect();
        for value in VALUES {
            for &place in &places {
                let (before, after) = line.split_at(place);
                let line = format!("{before}{value}{}", &after[1..]);
                // The other places hold something harmless.
                hostile.push(line.replace('@', "0.25"));
            }
        }
        let whole = line.replace('@', "0.25");
        hostile.extend((0..whole.len()).map(|end| whole[..end].to_owned()));
    }
    hostile
}
