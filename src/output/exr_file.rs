//! OpenEXR files: 32-bit floats by channel, in one part, with or without layers.

use std::io::Cursor;

use exr::prelude::*;

use super::metadata::Metadata;
use crate::engine::error::bound::ErrorSource;
use crate::scene::linear_image::check_layers;

/// Of a file that is read: as many as a picture may have.
const MOST_PIXELS: u64 = 1 << 28;

/// Values of all pixels, row by row from the top; `name` is R, or that of a layer before it: `albedo.R`.
pub(crate) struct Channel {
    pub name: String,
    pub values: Vec<f32>,
}

/// Three channels of a layer; `names` are theirs, the layer's before a dot.
pub(crate) fn channels(layer: &str, names: [&str; 3], values: impl Iterator<Item = glam::Vec3>) -> Vec<Channel> {
    let name = |channel: &str| if layer.is_empty() { channel.to_owned() } else { format!("{layer}.{channel}") };
    let mut channels = names.map(|channel| Channel { name: name(channel), values: Vec::with_capacity(values.size_hint().0) });
    for value in values {
        channels.iter_mut().zip(value.to_array()).for_each(|(channel, value)| channel.values.push(value));
    }
    channels.into()
}

/// Attribute of a file of standard errors.
pub(crate) const FREEDOM: &str = "degreesOfFreedom";

/// The file.
pub(crate) fn encode(size: (u32, u32), channels: Vec<Channel>, metadata: Option<&Metadata>) -> Vec<u8> {
    encode_with(size, channels, |attributes| metadata.into_iter().for_each(|metadata| metadata.set(attributes)))
}

/// A file of standard errors, which says from how many degrees of freedom they are, and what intervals follow.
pub(crate) fn encode_errors(size: (u32, u32), channels: Vec<Channel>, source: ErrorSource) -> Vec<u8> {
    encode_with(size, channels, |attributes| {
        attributes.comments = Some(Text::from_slice_unchecked(source.in_words().as_bytes()));
        attributes.other.insert(FREEDOM.into(), AttributeValue::I32(source.degrees_of_freedom as i32));
    })
}

fn encode_with((width, height): (u32, u32), channels: Vec<Channel>, set: impl FnOnce(&mut LayerAttributes)) -> Vec<u8> {
    let channel = |Channel { name, values }: Channel| AnyChannel::new(name.as_str(), FlatSamples::F32(values));
    let mut attributes = LayerAttributes::default();
    set(&mut attributes);
    let size = (width as usize, height as usize);
    let encoding = Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into_iter().map(channel).collect()));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).expect("a picture in memory can be encoded");
    file.into_inner()
}

/// From how many degrees of freedom a file says that its standard errors are; `None` where it does not say, or is no OpenEXR file.
pub(crate) fn freedom(content: &[u8]) -> Option<u32> {
    let meta = MetaData::read_from_buffered(Cursor::new(content), false).ok()?;
    match meta.headers.first()?.own_attributes.other.get(&Text::from(FREEDOM))? {
        AttributeValue::I32(freedom) => u32::try_from(*freedom).ok(),
        _ => None,
    }
}

/// Size and channels of a file of 32-bit floats in one part.
pub(crate) fn decode(content: &[u8]) -> std::result::Result<((u32, u32), Vec<Channel>), String> {
    check_layers(content, MOST_PIXELS)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(content))
        .map_err(|error| format!("cannot be read as OpenEXR ({error})"))?;
    let layer = image.layer_data;
    let channel = |channel: AnyChannel<FlatSamples>| match channel.sample_data {
        FlatSamples::F32(values) => Ok(Channel { name: channel.name.to_string(), values }),
        _ => Err(format!("holds other values than 32-bit floats in {}", channel.name)),
    };
    let channels = layer.channel_data.list.into_iter().map(channel).collect::<std::result::Result<_, _>>()?;
    Ok(((layer.size.0 as u32, layer.size.1 as u32), channels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_errors_say_how_many_degrees_of_freedom_they_have() {
        let one = || channels("", ["R", "G", "B"], [glam::Vec3::ONE].into_iter());
        let source = ErrorSource { degrees_of_freedom: 7, confidence: 0.95 };
        assert_eq!(freedom(&encode_errors((1, 1), one(), source)), Some(7));
        assert_eq!(freedom(&encode((1, 1), one(), None)), None);
        assert_eq!(freedom(b"no picture"), None);
    }
}
