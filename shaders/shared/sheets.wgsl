// The colour targets of a pass: the sheet buffers of a group of one, two or four sheets.
struct One {
    @location(0) sheet_0: vec4f,
}

struct Two {
    @location(0) sheet_0: vec4f,
    @location(1) sheet_1: vec4f,
}

struct Four {
    @location(0) sheet_0: vec4f,
    @location(1) sheet_1: vec4f,
    @location(2) sheet_2: vec4f,
    @location(3) sheet_3: vec4f,
}
