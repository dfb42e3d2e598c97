// Channels of one grid that share sheets (SPEC §10).

// Their number.
override CHANNELS: u32 = 1u;

// A sum over channels of numbers that are at least 0. It is formed from the smallest of them on, so that the order of up to four channels does not
// change it.
struct ChannelSum {
    // The sum of all but the three greatest.
    rest: vec4f,
    third: vec4f,
    second: vec4f,
    greatest: vec4f,
}

// The sum with the numbers of one more channel.
fn with_channel(sum: ChannelSum, numbers: vec4f) -> ChannelSum {
    let below_greatest = min(sum.greatest, numbers);
    let below_second = min(sum.second, below_greatest);
    return ChannelSum(
        sum.rest + min(sum.third, below_second),
        max(sum.third, below_second),
        max(sum.second, below_greatest),
        max(sum.greatest, numbers),
    );
}

fn total(sum: ChannelSum) -> vec4f {
    return ((sum.rest + sum.third) + sum.second) + sum.greatest;
}
