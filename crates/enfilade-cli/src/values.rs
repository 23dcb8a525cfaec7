//! Values of arguments that several commands take.

/// Reads `x,y,z`. [Units: wu]
///
/// # Errors
///
/// Anything but three finite numbers; the text says what is needed.
pub fn point(text: &str) -> Result<[f32; 3], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|w| w.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok([x, y, z]),
        _ => Err("three numbers of meters are needed, e.g. 1,1.6,-2.5".into()),
    }
}

/// Reads `WxH`, the size of a picture in pixels, neither of them 0.
///
/// # Errors
///
/// Anything else; the text says what is needed.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let parse = || {
        let (w, h) = text.split_once('x')?;
        let (w, h) = (w.parse::<u32>().ok()?, h.parse::<u32>().ok()?);
        (w > 0 && h > 0).then_some([w, h])
    };
    parse().ok_or_else(|| "a width and a height are needed, e.g. 1280x720".into())
}
