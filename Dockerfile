# The program, which draws on the processor's cores: docker build -t sheetsplat . && docker run --rm -v "$PWD:/data" sheetsplat render head.nrrd -o head.png
# A GPU needs its vendor's driver and the package libvulkan1 in the image.
FROM rust:1-bookworm AS build
WORKDIR /source
COPY . .
RUN cargo build --profile dist --locked

FROM debian:bookworm-slim
COPY --from=build /source/target/dist/sheetsplat /usr/local/bin/sheetsplat
RUN useradd --create-home user
USER user
WORKDIR /data
ENTRYPOINT ["sheetsplat"]
