// Channels of one grid (SPEC §10), whose values follow one another in `values`. A stage that includes this includes `volume`.

// The number of channels.
override CHANNELS: u32 = 1u;

// Makes a channel the one that is read.
fn read_channel(channel: u32) {
    first_value = channel * frame.dims.x * frame.dims.y * frame.dims.z;
}
