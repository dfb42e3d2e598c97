# The program with Mesa's software driver: docker build -t sheetsplat . && docker run --rm -v "$PWD:/data" sheetsplat render head.nrrd -o head.png
FROM rust:1-bookworm AS build
WORKDIR /source
COPY . .
RUN cargo build --profile dist --locked

FROM debian:bookworm-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends libvulkan1 mesa-vulkan-drivers \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /source/target/dist/sheetsplat /usr/local/bin/sheetsplat
RUN useradd --create-home user
USER user
WORKDIR /data
ENTRYPOINT ["sheetsplat"]
