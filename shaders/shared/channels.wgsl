// Channels of one grid that share sheets (SPEC §10).

// Their number.
override CHANNELS: u32 = 1u;
