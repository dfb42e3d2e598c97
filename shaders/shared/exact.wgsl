// Whether coefficients that interpolate values and colours are splatted instead of these (SPEC §9).
override EXACT: bool = false;
