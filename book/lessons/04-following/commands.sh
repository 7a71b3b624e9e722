semismooth follow beam.toml
