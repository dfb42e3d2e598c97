//! The decompressors of chunks, which never write more than a chunk should hold.
//!
//! zarrs' own read whatever a stream expands to, and are bindings to C.

use std::any::Any;
use std::borrow::Cow;
use std::io::Read;
use std::sync::{Arc, Once};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use ruzstd::decoding::FrameDecoder;
use zarrs::array::codec::api::{
    BytesToBytesCodecTraits, Codec, CodecError, CodecMetadataOptions, CodecOptions, CodecRuntimePluginV2,
    CodecRuntimePluginV3, CodecTraits, PartialDecoderCapability, PartialEncoderCapability, RecommendedConcurrency,
    register_codec_v2, register_codec_v3,
};
use zarrs::array::{ArrayBytesRaw, BytesRepresentation};
use zarrs::metadata::Configuration;
use zarrs::plugin::{ExtensionName, ZarrVersion};

use super::blosc;

/// A compression. What else its metadata states concerns only writers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    Blosc,
    Bzip2,
    Gzip,
    Zlib,
    Zstandard,
}

/// The names in metadata of versions 2 and 3.
const NAMED: [(&str, Compression); 9] = [
    ("blosc", Compression::Blosc),
    ("bz2", Compression::Bzip2),
    ("numcodecs.bz2", Compression::Bzip2),
    ("gzip", Compression::Gzip),
    ("zlib", Compression::Zlib),
    ("numcodecs.zlib", Compression::Zlib),
    ("numcodecs.blosc", Compression::Blosc),
    ("zstd", Compression::Zstandard),
    ("numcodecs.zstd", Compression::Zstandard),
];

/// The names of compressions, for errors.
pub(super) const NAMES: &str = "blosc, bz2, gzip, zlib, zstd";

/// Tells zarrs about the decompressors.
pub(super) fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for (name, compression) in NAMED {
            let codec = move || Ok(Codec::BytesToBytes(Arc::new(compression)));
            register_codec_v2(CodecRuntimePluginV2::new(move |other| other == name, move |_| codec()));
            register_codec_v3(CodecRuntimePluginV3::new(move |other| other == name, move |_| codec()));
        }
    });
}

impl Compression {
    /// Decodes at most `limit` bytes.
    fn expand(self, code: &[u8], limit: u64) -> Result<Vec<u8>, String> {
        let all = |reader: &mut dyn Read| -> Result<Vec<u8>, String> {
            let mut decoded = Vec::new();
            // One more, which tells that there are too many.
            let read = reader.take(limit.saturating_add(1)).read_to_end(&mut decoded);
            read.map_err(|error| error.to_string())?;
            Ok(decoded)
        };
        let decoded = match self {
            Self::Blosc => blosc::decode(code, limit as usize)?,
            Self::Bzip2 => all(&mut MultiBzDecoder::new(code))?,
            Self::Gzip => all(&mut MultiGzDecoder::new(code))?,
            Self::Zlib => all(&mut ZlibDecoder::new(code))?,
            Self::Zstandard => {
                let mut decoded = vec![0; limit as usize];
                let written = zstandard(code, &mut decoded)?;
                decoded.truncate(written);
                decoded
            }
        };
        if decoded.len() as u64 > limit {
            return Err(format!("more than the {limit} bytes that it should have"));
        }
        Ok(decoded)
    }
}

/// Decodes frames of Zstandard and returns the number of bytes.
pub(super) fn zstandard(code: &[u8], into: &mut [u8]) -> Result<usize, String> {
    // Writers that do not know a chunk's length state a larger window, of which the decoder allocates all.
    const WINDOW: u64 = 8 << 20;
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(WINDOW.max(into.len() as u64));
    decoder.decode_all(code, into).map_err(|error| error.to_string())
}

impl ExtensionName for Compression {
    fn name(&self, _: ZarrVersion) -> Option<Cow<'static, str>> {
        NAMED.iter().find(|(_, compression)| compression == self).map(|(name, _)| Cow::Borrowed(*name))
    }
}

impl CodecTraits for Compression {
    fn as_any(&self) -> &dyn Any {
        self
    }

    fn configuration(&self, _: ZarrVersion, _: &CodecMetadataOptions) -> Option<Configuration> {
        Some(Configuration::default())
    }

    fn partial_decoder_capability(&self) -> PartialDecoderCapability {
        PartialDecoderCapability { partial_read: false, partial_decode: false }
    }

    fn partial_encoder_capability(&self) -> PartialEncoderCapability {
        PartialEncoderCapability { partial_encode: false }
    }
}

impl BytesToBytesCodecTraits for Compression {
    fn into_dyn(self: Arc<Self>) -> Arc<dyn BytesToBytesCodecTraits> {
        self
    }

    fn recommended_concurrency(&self, _: &BytesRepresentation) -> Result<RecommendedConcurrency, CodecError> {
        Ok(RecommendedConcurrency::new_maximum(1))
    }

    fn encoded_representation(&self, decoded: &BytesRepresentation) -> BytesRepresentation {
        // No compression makes a chunk that much longer.
        decoded.size().map_or(BytesRepresentation::UnboundedSize, |bytes| {
            BytesRepresentation::BoundedSize(bytes.saturating_mul(2).saturating_add(1 << 16))
        })
    }

    fn encode<'a>(&self, _: ArrayBytesRaw<'a>, _: &CodecOptions) -> Result<ArrayBytesRaw<'a>, CodecError> {
        Err(CodecError::Other("this is a decoder".to_owned()))
    }

    fn decode<'a>(
        &self,
        encoded: ArrayBytesRaw<'a>,
        decoded: &BytesRepresentation,
        _: &CodecOptions,
    ) -> Result<ArrayBytesRaw<'a>, CodecError> {
        let limit = decoded.size().ok_or_else(|| CodecError::Other("a chunk of any size".to_owned()))?;
        self.expand(&encoded, limit).map(Cow::Owned).map_err(|error| CodecError::Other(format!("{self:?}: {error}")))
    }
}
